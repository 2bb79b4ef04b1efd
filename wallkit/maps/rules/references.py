"""P, what a file leaves to others: meshes that are not there or not the map's own, and xacro that was never expanded."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from wallkit.maps.document import Attribute, Element
from wallkit.maps.nouns import MeshFile
from wallkit.maps.read import mesh_file
from wallkit.maps.rules.base import Context, Problem, Rule

# these name a file of some ROS package or Gazebo model: they may be right elsewhere, but lead nowhere from here
_PACKAGE = re.compile(r"(package|model)://")
_EXPRESSION = re.compile(r"\$\{[^}]*\}?|\$\([^)]*\)?")
_XACRO = re.compile(r"https?://(www\.)?(ros\.org/wiki/xacro|wiki\.ros\.org/xacro|.*\bxacro\b.*)")
_NAMED_FOLDERS = 3


def meshes(context: Context) -> list[tuple[Element, MeshFile]]:
    """Every <mesh> of a collision or visual, and where its file is."""
    folder = Path(context.document.source).parent
    return [
        (element, mesh_file(element.get("filename") or "", folder))
        for element in context.root.iter()
        if element.tag == "mesh" and element.get("filename") is not None
    ]


def p010_mesh_missing(context: Context) -> Iterator[Problem]:
    """Meshes are not found; all of a map's in one finding.

    Where one is a <collision>, walls or fixtures are missing for the LiDAR: give them a <box>. Where all are <visual>, only
    pictures miss them (warning).

    Bad: <link name="a"><collision><geometry><mesh filename="package://flat/sofa.stl"/></geometry></collision></link>
    Good: <link name="a"><collision><geometry><box size="2 0.9 0.8"/></geometry></collision></link>
    """
    missing = [(element, mesh) for element, mesh in context.once(meshes) if not _leaves(mesh) and not mesh.is_on_disk()]
    if not missing:
        return
    solid = [(element, mesh) for element, mesh in missing if _stands_in(element, "collision")]
    first, mesh = (solid or missing)[0]
    folders = Counter(str(PurePosixPath(found.filename).parent) for _, found in missing)
    said = ", ".join(f"{count} in '{_shown(name)}'" for name, count in folders.most_common(_NAMED_FOLDERS))
    more = f", and {len(folders) - _NAMED_FOLDERS} more folders" if len(folders) > _NAMED_FOLDERS else ""
    if len(missing) == 1:
        message = f"mesh '{mesh.filename}' is not found"
    else:
        message = f"{len(missing)} meshes are not found: {said}{more}"
    if solid and len(missing) > 1:
        message += f"; {len(solid)} of them are <collision>, this is the first"
    why = f" ({mesh.problem})" if mesh.problem else ""
    yield Problem(
        first.spot("filename"),
        message,
        f"put the files beside the map and name them from there, or give collisions a <box>{why}",
        severity="error" if solid else "warning",
        detail={"count": len(missing), "collisions": len(solid), "folders": dict(folders)},
    )


def p011_mesh_leaves(context: Context) -> Iterator[Problem]:
    """A mesh's name leads out of the map's folder: an absolute path, a URL, or '..' beyond it. It is never opened.

    Bad: <link name="a"><visual><geometry><mesh filename="../../etc/sofa.stl"/></geometry></visual></link>
    Good: <link name="a"><visual><geometry><box size="2 0.9 0.8"/></geometry></visual></link>
    """
    for element, mesh in context.once(meshes):
        if _leaves(mesh):
            message = f"mesh '{mesh.filename}': {mesh.problem}"
            yield Problem(element.spot("filename"), message, "name a file beside the map or in a folder below it")


def p012_xacro(context: Context) -> Iterator[Problem]:
    """Something of xacro was not expanded; each expression is told once.

    Readers take ${prefix} as the letters of a name.

    Bad: <link name="${prefix}wall"/>
    Good: <link name="a_wall"/>
    """
    hint = f"xacro {context.document.source} > map.urdf"
    first: dict[str, Attribute | Element] = {}
    counts: Counter[str] = Counter()
    for element in context.root.iter():
        if _XACRO.fullmatch(element.namespace) or element.name.startswith("xacro:"):
            counts[f"<{element.name}>"] += 1
            first.setdefault(f"<{element.name}>", element)
            continue
        texts = [*element.attrs.items(), ("", element.text)]
        for name, value in texts:
            for expression in dict.fromkeys(_EXPRESSION.findall(value) if "$" in value else ()):
                counts[expression] += 1
                if expression not in first:
                    first[expression] = element.spot(name) if name else element
    for expression, at in first.items():
        times = f" in {counts[expression]} places, this is the first" if counts[expression] > 1 else ""
        yield Problem(at, f"{expression} of xacro is not expanded{times}", hint, detail={"count": counts[expression]})


# -------------------------------------------------------------------------------------------- details


def _leaves(mesh: MeshFile) -> bool:
    return mesh.path is None and bool(mesh.filename.strip()) and not _PACKAGE.match(mesh.filename)


def _stands_in(element: Element, tag: str) -> bool:
    return any(ancestor.tag == tag for ancestor in element.ancestors())


def _shown(folder: str) -> str:
    """A folder as it was written: PurePosixPath takes one slash of package://."""
    return re.sub(r"^(package|model):/(?!/)", r"\1://", folder)


RULES = (
    Rule("WK-P010", "error", p010_mesh_missing),
    Rule("WK-P011", "error", p011_mesh_leaves),
    Rule("WK-P012", "error", p012_xacro),
)
