"""E, single elements: sizes that can be built, walls that stand upright on the floor, angles that were meant exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from wallkit.maps.document import Attribute, Element
from wallkit.maps.nouns import Shape
from wallkit.maps.numbers import ROUNDED_RAD, meant_angle, numbers_from_text, text_from_number
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.solids import sound_parts, sound_runs

_THIN_CLASSES = ("glass", "mirror", "window")
# what begins higher up is a lintel, not a wall that hangs in the air
_LINTEL_M = 1.5


def e001_negative_size(context: Context) -> Iterator[Problem]:
    """A size is negative. Most readers take it without a word, some turn the shape inside out.

    Bad: <link name="a"><collision><geometry><box size="-1 1 1"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for name, shape in _shapes(context):
        if np.any(shape.size < 0) and shape.kind != "mesh":
            message = f"{shape.kind} of '{name}' has a negative size, {_written(shape)}"
            yield Problem(_size_spot(shape), message, "sizes are full lengths in metres")


def e002_zero_size(context: Context) -> Iterator[Problem]:
    """A size is zero: the element has no volume, and a LiDAR would see it or not as the reader likes.

    Bad: <link name="a"><collision><geometry><box size="1 0 1"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"><collision><geometry><box size="1 0.1 1"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for name, shape in _shapes(context):
        if np.any(shape.size == 0) and not np.any(shape.size < 0):
            message = f"{shape.kind} of '{name}' has a size of zero, {_written(shape)}"
            yield Problem(_size_spot(shape), message, "give it its real thickness, in metres")


def e003_thin(context: Context) -> Iterator[Problem]:
    """An element is thinner than 5 mm. Glass and mirrors may be.

    Bad: <link name="a"><collision><geometry><box size="1 0.001 1"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    Good: <link name="a"><collision><geometry><box size="1 0.1 1"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="a"/></joint>
    """
    for part in context.once(sound_parts):
        info = context.map.classes.get(part.class_name)
        see_through = part.class_name in _THIN_CLASSES or (info is not None and info.lidar in ("glass", "mirror"))
        thickness_m = float(part.shape.size.min())
        if thickness_m < context.tolerances.thin_m and not see_through:
            message = f"'{part.name}' is only {thickness_m * 1000:.4g} mm thick"
            yield Problem(_size_spot(part.shape), message, "sizes are metres", xyz=tuple(part.T_map_shape[:3, 3]))


def e004_thick_wall(context: Context) -> Iterator[Problem]:
    """A wall is thicker than 0.8 m, or hardly longer than it is thick: rather a column, or a room drawn as one box.

    Bad: <link name="wall_a"><collision><geometry><box size="4 3 2.5"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for run in context.once(sound_runs):
        if run.thickness_m > context.tolerances.thick_m:
            message = f"wall '{run.link}' is {run.thickness_m:.3g} m thick"
            hint = "walls thicker than 0.8 m are rare; a solid block is a column"
        elif run.length_m < context.tolerances.aspect * run.thickness_m:
            message = f"wall '{run.link}' is {run.length_m:.3g} m long and {run.thickness_m:.3g} m thick"
            hint = 'is it a column (class="column")?'
        else:
            continue
        spot = run.parts[0].shape.geometry.spot("size")
        yield Problem(spot, message, hint, xyz=tuple((run.start + run.end) / 2))


def e005_tall_wall(context: Context) -> Iterator[Problem]:
    """A wall is taller than a storey. One file holds one level.

    Bad: <link name="wall_a"><collision><geometry><box size="4 0.1 12"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    for run in context.once(sound_runs):
        if run.height_m > context.tolerances.tall_m:
            message = f"wall '{run.link}' is {run.height_m:.3g} m high"
            spot = max(run.parts, key=lambda part: part.z_m[1]).shape.geometry.spot("size")
            yield Problem(spot, message, "write one file per level", xyz=tuple((run.start + run.end) / 2))


def e021_off_floor(context: Context) -> Iterator[Problem]:
    """A wall does not reach the floor (z = 0), or ends below the LiDAR's plane: scans pass where the building stops them.

    Lintels, which begin above 1.5 m, are no such walls.

    Bad: <link name="wall_a"><collision><origin xyz="0 0 1.65"/>
         <geometry><box size="4 0.1 2.5"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    Good: <link name="wall_a"><collision><origin xyz="0 0 1.25"/>
          <geometry><box size="4 0.1 2.5"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/></joint>
    """
    plane_m = context.scan_plane_m
    for run in context.once(sound_runs):
        low, high = run.z_m
        unseen = f": the LiDAR at {plane_m:g} m does not see it" if plane_m and not low <= plane_m < high else ""
        joint = context.map.parent_joint(run.link)
        spot = joint.element if joint is not None else run.parts[0].shape.element
        middle = tuple((run.start + run.end) / 2)
        if context.tolerances.floor_gap_m < low < _LINTEL_M:
            message = f"wall '{run.link}' starts {low:.3g} m above the floor{unseen}"
            yield Problem(spot, message, "a wall's frame sits on the floor, its box half its height above", xyz=middle)
        elif unseen and high <= (plane_m or 0.0):
            yield Problem(spot, f"wall '{run.link}' ends {high:.3g} m above the floor{unseen}", xyz=middle)


def e030_rounded_angle(context: Context) -> Iterator[Problem]:
    """An angle is a rounded multiple of 45 degrees, as 1.57: at the far end of a wall that is millimetres.

    Bad: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/><origin rpy="0 0 1.57"/></joint>
    Good: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/><origin rpy="0 0 1.5707963"/>
          </joint>
    """
    for name, attribute, reach_m in _angles(context):
        words = attribute.value.split()
        exact = [meant_angle(word) for word in words]
        if any(angle is not None for angle in exact):
            pairs = list(zip(words, exact, strict=True))
            off_rad = max(abs(float(word) - angle) for word, angle in pairs if angle is not None)
            text = " ".join(word if angle is None else f"{angle:.7f}" for word, angle in pairs)
            rounded = ", ".join(word for word, angle in pairs if angle is not None)
            message = (
                f"angle {rounded} of '{name}' is a rounded constant: {off_rad * 1000:.2g} mrad off, "
                f"{off_rad * reach_m * 1000:.2g} mm at the far end"
            )
            yield Problem(attribute, message, f'rpy="{text}"', edits=(attribute.replaced_by(text),))


def e031_degrees(context: Context) -> Iterator[Problem]:
    """An angle is more than a full turn: it was written in degrees.

    Bad: <link name="a"/><joint name="at_a" type="fixed"><parent link="map"/><child link="a"/><origin rpy="0 0 90"/></joint>
    Good:
      <link name="a"/><joint name="at_a" type="fixed"><parent link="map"/><child link="a"/>
      <origin rpy="0 0 1.5707963"/></joint>
    """
    for name, attribute, _ in _angles(context):
        words = attribute.value.split()
        if any(abs(float(word)) > 2 * math.pi + ROUNDED_RAD for word in words):
            text = " ".join(text_from_number(math.radians(float(word)), 8) for word in words)
            message = f"the angles of '{name}', {attribute.value}, are more than a full turn: degrees?"
            yield Problem(attribute, message, f'rpy="{text}"', edits=(attribute.replaced_by(text),))


def e032_tilted_wall(context: Context) -> Iterator[Problem]:
    """A wall leans.

    Bad: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
         <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/><origin rpy="0.1 0 0"/></joint>
    Good: <link name="wall_a"><collision><geometry><box size="4 0.1 2.5"/></geometry></collision></link>
          <joint name="at_a" type="fixed"><parent link="map"/><child link="wall_a"/><origin rpy="0 0 0"/></joint>
    """
    for part in context.once(sound_parts):
        if part.class_name == "wall" and part.shape.kind == "box":
            tilt_rad = math.acos(min(1.0, float(np.abs(part.T_map_shape[2, :3]).max())))
            if tilt_rad > context.tolerances.tilt_rad:
                joint = context.map.parent_joint(part.link)
                message = f"wall part '{part.name}' leans by {math.degrees(tilt_rad):.2g} degrees"
                spot = joint.element if joint is not None else part.shape.element
                yield Problem(
                    spot, message, "rpy is roll, pitch, yaw: walls have only yaw", xyz=tuple(part.T_map_shape[:3, 3])
                )


# -------------------------------------------------------------------------------------------- details


def _shapes(context: Context) -> Iterator[tuple[str, Shape]]:
    for link in context.map.links.values():
        for shape in link.shapes:
            yield shape.name or link.name, shape


def _written(shape: Shape) -> str:
    return " x ".join(f"{value:g}" for value in shape.size)


def _size_spot(shape: Shape) -> Attribute | Element:
    if shape.kind in ("box", "mesh"):
        return shape.geometry.spot("size" if shape.kind == "box" else "scale")
    radius_is_wrong = shape.size[0] <= 0
    return shape.geometry.spot("radius" if radius_is_wrong else "length")


def _angles(context: Context) -> Iterator[tuple[str, Attribute, float]]:
    """Every readable rpy of joints and collisions: whose it is, where, and how far (metres) what it turns reaches."""
    for joint in context.map.joints.values():
        attribute = _rpy(joint.element)
        if attribute is not None:
            yield joint.name, attribute, _reach_m(context, joint.child)
    for name, shape in _shapes(context):
        attribute = _rpy(shape.element)
        if attribute is not None:
            yield name, attribute, float(np.linalg.norm(shape.size)) / 2


def _rpy(element: Element) -> Attribute | None:
    origin = element.find("origin")
    attribute = origin.attribute("rpy") if origin is not None and origin.get("rpy") not in (None, "0 0 0") else None
    return attribute if attribute is not None and numbers_from_text(attribute.value, 3) else None


def _reach_m(context: Context, link: str) -> float:
    """From a link's frame to the farthest corner of what it carries."""
    if link not in context.poses:
        return 0.0
    origin = context.poses[link][:3, 3]
    carried = (part for name in context.map.subtree(link) for part in context.parts_by_link.get(name, ()))
    return max((float(np.linalg.norm(part.corners - origin, axis=1).max()) for part in carried), default=0.0)


RULES = (
    Rule("WK-E001", "error", e001_negative_size),
    Rule("WK-E002", "error", e002_zero_size),
    Rule("WK-E003", "warning", e003_thin),
    Rule("WK-E004", "warning", e004_thick_wall),
    Rule("WK-E005", "warning", e005_tall_wall),
    Rule("WK-E021", "warning", e021_off_floor),
    Rule("WK-E030", "warning", e030_rounded_angle, fix="safe"),
    Rule("WK-E031", "error", e031_degrees, fix="moderate"),
    Rule("WK-E032", "warning", e032_tilted_wall),
)
