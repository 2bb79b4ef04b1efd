"""A map file -> what other programs make of it: predicted from the rules, and seen by loading it with yourdfpy."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.findings.compat import ToolView, views_of
from wallkit.maps.findings.judged import Judged
from wallkit.maps.model import SemanticMap
from wallkit.pipelines.map.verdicts import Selection, judge

_GROUPS = ("X", "S", "G", "P")
# yourdfpy takes minutes for a few thousand links
_MOST_LINKS = 1500
_SAME_M = 1e-6


@dataclass(frozen=True)
class Compat:
    """What other programs make of a file.

    Attributes:
        judged: the findings of groups X, S, G and P. views: one per program.
        loaded: what loading it with yourdfpy showed; "" when it was not tried. is_same: it has the same links in the same
            places; None when that was not seen.
    """

    judged: Judged
    views: tuple[ToolView, ...]
    loaded: str = ""
    is_same: bool | None = None

    @property
    def is_good(self) -> bool:
        """Every program loads it as it is meant."""
        return all(view.outcome == "loads" for view in self.views) and self.is_same is not False


def compat_of(path: Path, selection: Selection, *, with_yourdfpy: bool = False) -> Compat:
    """What other programs make of a file.

    Raises:
        MapError: it cannot be read from disk.
    """
    chosen = replace(selection, select=selection.select or _GROUPS)
    (judged,) = judge([path], chosen)
    report = judged.report
    found = Compat(judged, tuple(views_of(report.findings, report.document)))
    if not with_yourdfpy:
        return found
    has_bad_xml = any(finding.code[3] == "X" and finding.severity == "error" for finding in report.findings)
    if has_bad_xml or report.map is None:
        return replace(found, loaded="not tried: the XML is not sound")
    if len(report.map.links) > _MOST_LINKS:
        return replace(found, loaded=f"not tried: {len(report.map.links):,} links take it minutes")
    return _loaded_by_yourdfpy(path, found, report.map)


# -------------------------------------------------------------------------------------------- details


def _loaded_by_yourdfpy(path: Path, found: Compat, semantic_map: SemanticMap) -> Compat:
    import yourdfpy

    log = logging.getLogger("yourdfpy")
    before, log.disabled = log.disabled, True
    try:
        robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
        poses = {name: robot.get_transform(name, robot.base_link) for name in robot.link_map}
    except Exception as error:  # noqa: BLE001 - whatever it raises on a file is its verdict on it
        return replace(found, loaded=f"stopped with {type(error).__name__}: {error}", is_same=False)
    finally:
        log.disabled = before
    expected = semantic_map.poses(dict.fromkeys(_free(semantic_map), 0.0))
    off = _misplaced(poses, expected)
    missing = [name for name in expected if name not in poses]
    if missing or off:
        names = ", ".join(f"'{name}'" for name in [*missing, *off][:3])
        return replace(found, loaded=f"{len(missing)} links missing, {len(off)} elsewhere: {names}", is_same=False)
    return replace(found, loaded=f"loaded: {len(poses)} links in the same places", is_same=True)


def _free(semantic_map: SemanticMap) -> list[str]:
    return [joint.name for joint in semantic_map.joints.values() if joint.is_movable and joint.mimic is None]


def _misplaced(poses: dict[str, Float64Array], expected: dict[str, Float64Array]) -> Sequence[str]:
    return [n for n, T in expected.items() if n in poses and not np.allclose(poses[n], T, atol=_SAME_M, equal_nan=True)]
