"""Group L: whether a robot can tell where it is: places that look alike, directions left open, nothing in range."""

from __future__ import annotations

import math
from collections.abc import Iterator

from wallkit.core.types import Float64Array
from wallkit.maps.document import wk
from wallkit.maps.rules.base import Context, Problem, Rule, Where
from wallkit.maps.rules.outlook import ambiguity, places, robot_in_words, seen
from wallkit.maps.score.rivals import CONTINUUM, MOST_RIVALS
from wallkit.maps.score.score import Ambiguity


def check_ambiguity(context: Context) -> Iterator[Problem]:
    """From many places the scan looks as it does from another place.

    No filter can tell two places apart at which the LiDAR measures the same. A pose is ambiguous when another pose, more
    than 0.5 m or 30 degrees away, explains at least 90 % of its beams within 5 cm. A square room has four such poses, a
    rectangle two, a long corridor a whole line. More than 10 % of ambiguous poses is a warning, more than 50 % an error
    (rules.ambiguous_warn, ambiguous_error). Range and robot radius are those of <wk:check>, else 12 m and 0.25 m.

    Up to 400 poses on at most 150 m2 are judged, and only a share that is surely above a limit is told; `wallkit map score`
    judges the whole floor.

    Bad:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision>
        <collision><origin xyz="2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    Good:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision>
        <collision><origin xyz="2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
      <link name="column"><wk:object class="column"/>
        <collision><origin xyz="-1.75 1.3 1"/><geometry><box size="1.5 1.4 2"/></geometry></collision></link>
      <joint name="at_column" type="fixed"><parent link="map"/><child link="column"/></joint>
    """
    found = context.once(ambiguity)
    if found is None or found.ambiguity.is_surely(context.tolerances.ambiguous_warn) <= 0:
        return
    poses, judged = found.poses, found.ambiguity
    where = f" on {found.area_m2:.0f} m2 of the floor" if found.is_part else ""
    worst = judged.worst(poses, 3).tolist()
    listed = "; ".join(f"{pose_in_words(poses[i])} looks like {pose_in_words(judged.rivals[i])}" for i in worst)
    yield Problem(
        map_spot(context),
        f"{judged.share:.0%} of {len(poses)} poses{where} are ambiguous, most of them with {modes_in_words(judged)} "
        f"({robot_in_words(context)}); worst: {listed}",
        f"`wallkit map score {context.document.source} -o heat.png` shows where, and which class would help",
        xyz=(float(poses[worst[0], 0]), float(poses[worst[0], 1])),
        severity="error" if judged.is_surely(context.tolerances.ambiguous_error) > 0 else "warning",
        detail={
            "share": judged.share,
            "poses": len(poses),
            "modes": {str(modes): count for modes, count in judged.mode_counts.items()},
            "worst": [poses[i].tolist() for i in worst],
        },
    )


def check_degenerate(context: Context) -> Iterator[Problem]:
    """From many places all walls in range run the same way, so nothing tells how far along them the robot is.

    In a corridor longer than the LiDAR's range, only odometry says how far the robot has come. The finding gives the share
    of such places and the direction left open, from the map's x axis. Above 10 % it is told (rules.degenerate_warn).

    Bad:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -1.05 1"/><geometry><box size="50.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 1.05 1"/><geometry><box size="50.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-25.05 0 1"/><geometry><box size="0.1 2 2"/></geometry></collision>
        <collision><origin xyz="25.05 0 1"/><geometry><box size="0.1 2 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    Good:
      <wk:map format="1.0" scan_plane="0.3"><wk:check max-range="60"/></wk:map>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -1.05 1"/><geometry><box size="50.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 1.05 1"/><geometry><box size="50.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-25.05 0 1"/><geometry><box size="0.1 2 2"/></geometry></collision>
        <collision><origin xyz="25.05 0 1"/><geometry><box size="0.1 2 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    """
    found, poses = context.once(seen), context.once(places)
    if found is None or poses is None or found.open_direction is None:
        return
    share = float(found.degenerate.mean())
    if share <= context.tolerances.degenerate_warn:
        return
    first = poses[found.degenerate][0]
    yield Problem(
        map_spot(context),
        f"from {share:.0%} of the floor all surfaces in range run along {math.degrees(found.open_direction):.0f} deg "
        f"({robot_in_words(context)}): nothing tells how far along the robot is",
        "put something along it that the LiDAR sees (a column, a recess, a cabinet), or use a LiDAR of longer range",
        xyz=(float(first[0]), float(first[1])),
        detail={"share": share, "direction_rad": found.open_direction},
    )


def check_empty(context: Context) -> Iterator[Problem]:
    """From some places nothing at all is in the LiDAR's range.

    The map is larger than the LiDAR reaches, and a robot in the middle of the floor gets empty scans: it then knows its
    place from odometry alone. The finding gives the share of such places.

    Bad:
      <wk:map format="1.0" scan_plane="0.3"><wk:check max-range="3"/></wk:map>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -5.05 1"/><geometry><box size="12.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 5.05 1"/><geometry><box size="12.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-6.05 0 1"/><geometry><box size="0.1 10 2"/></geometry></collision>
        <collision><origin xyz="6.05 0 1"/><geometry><box size="0.1 10 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    Good:
      <wk:map format="1.0" scan_plane="0.3"><wk:check max-range="10"/></wk:map>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -5.05 1"/><geometry><box size="12.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 5.05 1"/><geometry><box size="12.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-6.05 0 1"/><geometry><box size="0.1 10 2"/></geometry></collision>
        <collision><origin xyz="6.05 0 1"/><geometry><box size="0.1 10 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    """
    found, poses = context.once(seen), context.once(places)
    if found is None or poses is None or not found.is_empty.any():
        return
    first = poses[found.is_empty][0]
    yield Problem(
        map_spot(context),
        f"from {float(found.is_empty.mean()):.1%} of the floor nothing is in range ({robot_in_words(context)})",
        "say the LiDAR's range: <wk:check max-range=...>; or keep the robot near walls there",
        xyz=(float(first[0]), float(first[1])),
        detail={"share": float(found.is_empty.mean())},
    )


# -------------------------------------------------------------------------------------------- details


def map_spot(context: Context) -> Where:
    """Where findings about the map as a whole point: its <wk:map>, else the root."""
    header = context.root.find(wk("map"))
    return context.root if header is None else header


def modes_in_words(judged: Ambiguity) -> str:
    """How many poses explain the same scan, for the most frequent number among ambiguous poses."""
    counts = {modes: count for modes, count in judged.mode_counts.items() if modes != 1}
    typical = next(iter(counts), 1)
    if typical == CONTINUUM:
        return "a whole line of poses alike"
    return f"{typical} modes" if typical <= MOST_RIVALS else f"more than {MOST_RIVALS} modes"


def pose_in_words(pose: Float64Array) -> str:
    """(x, y, heading), in metres and degrees."""
    x, y, yaw = pose.tolist()
    return f"({x:.2f}, {y:.2f}, {math.degrees(yaw) % 360:.0f} deg)"


RULES = (
    Rule("WK-L003", "warning", check_ambiguity, blocks=False),
    Rule("WK-L004", "warning", check_degenerate),
    Rule("WK-L008", "info", check_empty),
)
