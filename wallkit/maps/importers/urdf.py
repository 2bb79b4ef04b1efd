"""Plain URDF -> the same file as a semantic map: a header, and the class of every link as its name tells; all else stays."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from wallkit.maps.draft.draft import Draft
from wallkit.maps.importers.imported import Imported, ImportOptions, Notes, tally
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import MeshFile
from wallkit.maps.read import load_map


def read_urdf(path: Path, options: ImportOptions) -> Imported:
    """The file with classes said, byte for byte otherwise; its draft has a name and nothing in it.

    Raises:
        MapError: rules of the groups X, S or G find an error in it.
    """
    # the editing verbs read units through the importers
    from wallkit.maps.document import apply_edits
    from wallkit.maps.edit.adopt import adopt
    from wallkit.maps.rules.base import Context

    semantic_map = load_map(path)
    notes = Notes(path)
    links, joints = semantic_map.links, semantic_map.joints
    kinds = tally(joint.kind for joint in joints.values())
    notes.read(f"{len(links)} links, {len(joints)} joints: {kinds}", links=len(links), joints=len(joints))
    changes = adopt(
        Context(semantic_map.document),
        level=semantic_map.header.level or "1",
        elevation_m=semantic_map.header.elevation_m or 0.0,
        scan_plane_m=options.scan_plane_m,
    )
    for line in changes.said:
        line = line.replace("; say it: --class NAME=CLASS", "")  # the flag of `map adopt`
        notes.guessed(
            line, hint="`wallkit map set FILE NAME class=CLASS` says another" if "by its name" in line else ""
        )
    _say_meshes(semantic_map, notes)
    data = apply_edits(semantic_map.document.data, changes.edits)
    draft = Draft(path.name.split(".")[0], level=semantic_map.header.level or "1", source=path.name)
    return Imported((draft,), tuple(notes.found), data)


def _say_meshes(semantic_map: SemanticMap, notes: Notes) -> None:
    """Meshes as one note for each reason why they are not there, and one for those that are."""
    meshes = [shape.mesh for link in semantic_map.links.values() for shape in link.shapes if shape.mesh]
    reasons = Counter(map(_reason, meshes))
    for reason, count in reasons.items():
        first = next(m.filename for m in meshes if _reason(m) == reason)
        what = (
            f"{count} collision meshes are missing ({reason}), the first is '{first}'" if reason else f"{count} meshes"
        )
        notes.skipped(
            f"{what}: meshes stay named, and the map's geometry does without them",
            hint="give what the LiDAR can see a <box> in its <collision>",
            count=count,
        )


def _reason(mesh: MeshFile) -> str:
    """Why a mesh is not there; "" when it is."""
    return "" if mesh.is_on_disk() else mesh.problem or "no such file"
