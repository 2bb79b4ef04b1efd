"""E, units and extent: one element, or the whole map, in millimetres; coordinates of a survey pasted in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.document import Edit
from wallkit.maps.geometry import Part
from wallkit.maps.numbers import text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule

UNITS: Mapping[str, float] = {"millimetres": 1e-3, "centimetres": 1e-2, "inches": 0.0254, "feet": 0.3048}
# what real things measure, in metres: generous, as 1 to 1000 is what must be told apart
_USUAL_M: Mapping[str, tuple[float, float]] = {
    "door leaves are {} high": (1.6, 3.2),
    "walls are {} high": (0.3, 8.0),
    "walls are {} thick": (0.02, 1.2),
    "fixtures measure {}": (0.05, 3.0),
}
# a map that begins farther from its origin than this (and than its own size) was not drawn in a local frame
_AWAY_M = 50.0


@dataclass(frozen=True, slots=True)
class Outsized:
    """A part in another unit than its peers.

    Attributes:
        axes: of its size, too large by `ratio` (10, 100 or 1000) or so. peer_m: what its peers measure there.
    """

    part: Part
    axes: tuple[int, ...]
    ratio: float
    peer_m: float


def outsized(context: Context) -> dict[str, list[Outsized]]:
    """Parts by link that are in another unit than their peers; empty when the whole map is."""
    if context.once(wrong_unit) is not None:
        return {}
    boxes = [part for part in context.parts if part.shape.kind == "box"]
    if len(boxes) < 3:
        return {}
    sides = np.sort([part.shape.size for part in boxes], axis=1)
    longest = np.sort(sides[:, 2])
    peers: dict[str, Float64Array] = {}
    for name in {part.class_name for part in boxes}:
        alike = np.array([part.class_name == name for part in boxes])
        peers[name] = np.median(sides[alike if alike.sum() >= 3 else slice(None)], axis=0)
    found: dict[str, list[Outsized]] = {}
    for part, own in zip(boxes, sides, strict=True):
        # a wall may be much longer than most walls, but not than every other thing
        next_longest = longest[-2] if own[2] == longest[-1] else longest[-1]
        usual = np.array([*peers[part.class_name][:2], max(next_longest, peers[part.class_name][2])])
        ratios = own / usual
        large = ratios >= context.tolerances.scale_ratio
        if large.any():
            order = np.argsort(part.shape.size, kind="stable")
            worst = int(np.argmax(ratios))
            ratio = 10.0 ** round(math.log10(ratios[worst]))
            axes = tuple(sorted(int(axis) for axis in order[large]))
            found.setdefault(part.link, []).append(Outsized(part, axes, ratio, float(usual[worst])))
    return found


def wrong_unit(context: Context) -> tuple[str, tuple[str, ...]] | None:
    """The unit the whole map seems to be in, and what tells so; None when it is metres or cannot be told."""
    measured: dict[str, list[float]] = {kind: [] for kind in _USUAL_M}
    doors, wall_heights, wall_thicknesses, fixtures = measured
    leaves = {joint.child for joint in context.map.doors}
    for part in context.parts:
        info = context.map.classes.get(part.class_name)
        height_m = part.z_m[1] - part.z_m[0]
        if part.link in leaves:
            measured[doors].append(height_m)
        elif part.class_name == "wall":
            measured[wall_heights].append(height_m)
            measured[wall_thicknesses].append(float(part.shape.size.min()))
        elif info is not None and info.mount == "wall":
            measured[fixtures].append(float(part.shape.size.max()))
    usual = {kind: float(np.median(values)) for kind, values in measured.items() if values}
    odd = [kind for kind, value in usual.items() if not _is_usual(kind, value)]
    if len(odd) * 2 <= len(usual):
        return None
    for unit, metres in UNITS.items():
        if all(_is_usual(kind, value * metres) for kind, value in usual.items()):
            return unit, tuple(kind.format(f"{usual[kind]:.4g} m") for kind in odd)
    return None


def e040_outsized(context: Context) -> Iterator[Problem]:
    """One element is a hundred to a thousand times the size of its peers: it was entered in another unit.

    Bad:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4000 100 2500"/></geometry>
      </collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 3 0"/></joint>
      <link name="wall_c"><wk:object class="wall"/><collision><geometry><box size="3 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="c" type="fixed"><parent link="map"/><child link="wall_c"/><origin xyz="0 6 0"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
      <link name="wall_b"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="b" type="fixed"><parent link="map"/><child link="wall_b"/><origin xyz="0 3 0"/></joint>
      <link name="wall_c"><wk:object class="wall"/><collision><geometry><box size="3 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="c" type="fixed"><parent link="map"/><child link="wall_c"/><origin xyz="0 6 0"/></joint>
    """
    for found in (one for parts in context.once(outsized).values() for one in parts):
        size = found.part.shape.size
        meant = [value / found.ratio if axis in found.axes else value for axis, value in enumerate(size)]
        text = " ".join(text_from_number(value) for value in meant)
        attribute = found.part.shape.geometry.attribute("size")
        edits: tuple[Edit, ...] = (attribute.replaced_by(text),) if attribute else ()
        written = " x ".join(f"{value:g}" for value in size)
        message = (
            f"'{found.part.name}' is {written} m, up to {found.ratio:g} times the size of its peers "
            f"({found.peer_m:.3g} m)"
        )
        yield Problem(
            found.part.shape.geometry.spot("size"),
            message,
            f'size="{text}"',
            xyz=tuple(found.part.T_map_shape[:3, 3]),
            edits=edits,
            detail={"ratio": found.ratio},
        )


def e041_whole_map(context: Context) -> Iterator[Problem]:
    """The whole map is in another unit than metres, as its doors, walls and fixtures tell.

    Bad:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4000 100 2500"/></geometry>
      </collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    wrong = context.once(wrong_unit)
    if wrong is not None:
        unit, evidence = wrong
        message = f"the map seems to be in {unit}: {', '.join(evidence)}"
        yield Problem(
            context.root,
            message,
            f"wallkit map scale {context.document.source} {UNITS[unit]:g}",
            detail={"factor": UNITS[unit]},
        )


def e042_survey_coordinates(context: Context) -> Iterator[Problem]:
    """Something lies more than a kilometre from the origin: coordinates of a survey (UTM, say) were pasted in.

    Rasters and single-precision numbers lose millimetres out there. The map keeps its local frame, and <wk:origin> says
    where in the world that lies.

    Bad:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="382145.2 394881.75 0"/>
      </joint>
    Good:
      <wk:map format="1.0" units="m rad"><wk:origin kind="surveyed" epsg="32654" east="382145.2" north="3948811.75"/>
      </wk:map>
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="0 0 0"/></joint>
    """
    if context.once(wrong_unit) is not None:
        return
    far = {
        link: parts[0]
        for link, parts in context.parts_by_link.items()
        if link not in context.once(outsized) and _distance_m(parts[0]) > context.tolerances.far_m
    }
    if far:
        link, part = next(iter(far.items()))
        x, y = part.T_map_shape[:2, 3]
        more = f", and {len(far) - 1} more" if len(far) > 1 else ""
        joint = context.map.parent_joint(link)
        message = f"link '{link}' lies at {x:.1f} {y:.1f}, {_distance_m(part) / 1000:.0f} km from the origin{more}"
        hint = f'subtract that corner everywhere and keep it in <wk:origin kind="surveyed" east="{x:.2f}" north="{y:.2f}"/>'
        yield Problem(joint.element if joint else part.shape.element, message, hint, xyz=tuple(part.T_map_shape[:3, 3]))


def e043_extent(context: Context) -> Iterator[Problem]:
    """The map is larger than any building, or smaller than a room.

    Bad:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="0.5 0.1 2.5"/></geometry>
      </collision></link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    extent_m = _extent_m(context)
    limits = context.tolerances
    if not extent_m or context.once(wrong_unit) is not None or context.once(outsized):
        return
    if not limits.extent_min_m <= extent_m <= limits.extent_max_m:
        size = "small" if extent_m < limits.extent_min_m else "large"
        message = f"the whole map measures {extent_m:.3g} m across, which is {size} for a building"
        yield Problem(context.root, message, "lengths are metres; one file per level of one building")


def e044_away(context: Context) -> Iterator[Problem]:
    """The map begins far from its origin; a corner of the building makes a better one.

    Bad:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="300 200 0"/></joint>
    Good:
      <link name="wall_a"><wk:object class="wall"/><collision><geometry><box size="4 0.1 2.5"/></geometry></collision>
      </link>
      <joint name="a" type="fixed"><parent link="map"/><child link="wall_a"/><origin xyz="3 2 0"/></joint>
    """
    extent_m = _extent_m(context)
    if not extent_m or context.once(wrong_unit) is not None or context.once(outsized):
        return
    nearest = min(context.parts, key=_distance_m)
    away_m = _distance_m(nearest)
    if max(_AWAY_M, extent_m) < away_m <= context.tolerances.far_m:
        message = f"the map, {extent_m:.0f} m wide, begins {away_m:.0f} m from its origin with '{nearest.name}'"
        yield Problem(
            context.root,
            message,
            f"wallkit map origin {context.document.source}",
            xyz=tuple(nearest.T_map_shape[:3, 3]),
        )


# -------------------------------------------------------------------------------------------- details


def _is_usual(kind: str, value_m: float) -> bool:
    low, high = _USUAL_M[kind]
    return low <= value_m <= high


def _distance_m(part: Part) -> float:
    return float(np.hypot(*part.T_map_shape[:2, 3]))


def _extent_m(context: Context) -> float:
    """Diameter of the smallest circle around everything, seen from above, so that turning the map changes nothing."""
    import shapely

    if not context.parts:
        return 0.0
    points = shapely.multipoints(np.vstack([part.corners[:, :2] for part in context.parts]))
    return float(2 * shapely.minimum_bounding_radius(points))


RULES = (
    Rule("WK-E040", "error", e040_outsized, fix="moderate"),
    Rule("WK-E041", "error", e041_whole_map),
    Rule("WK-E042", "warning", e042_survey_coordinates),
    Rule("WK-E043", "warning", e043_extent),
    Rule("WK-E044", "info", e044_away),
)
