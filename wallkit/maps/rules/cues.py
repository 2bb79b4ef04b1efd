"""Group L: what there is to go by: glass that does not answer, things that move, classes that are seen."""

from __future__ import annotations

from collections.abc import Iterator

from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.localisation import map_spot
from wallkit.maps.rules.outlook import robot_in_words, seen, sound_world


def check_glass(context: Context) -> Iterator[Problem]:
    """Much of what the LiDAR could see is glass or mirror, which rarely answers.

    Beams pass through glass and are thrown elsewhere by mirrors, so that part of the boundary does not hold the robot. The
    finding gives its share of the length that can be seen at the LiDAR's height; above 30 % it is told (rules.glass_share).

    Bad:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -1.55 1"/><geometry><box size="6.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-3.05 0 1"/><geometry><box size="0.1 3 2"/></geometry></collision>
        <collision><origin xyz="3.05 0 1"/><geometry><box size="0.1 3 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
      <link name="pane"><wk:object class="glass"/>
        <collision><origin xyz="0 1.51 1"/><geometry><box size="6.2 0.02 2"/></geometry></collision></link>
      <joint name="at_pane" type="fixed"><parent link="map"/><child link="pane"/></joint>
    Good:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -1.55 1"/><geometry><box size="6.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 1.55 1"/><geometry><box size="6.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-3.05 0 1"/><geometry><box size="0.1 3 2"/></geometry></collision>
        <collision><origin xyz="3.05 0 1"/><geometry><box size="0.1 3 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
    """
    found = context.once(seen)
    if found is None or found.glass_share <= context.tolerances.glass_share:
        return
    yield Problem(
        map_spot(context),
        f"{found.glass_share:.0%} of the visible boundary is glass or mirror ({robot_in_words(context)})",
        "map what stands before and behind it, or give the LiDAR strips at its height and map them as opaque",
        detail={"share": found.glass_share},
    )


def check_movable(context: Context) -> Iterator[Problem]:
    """Much of what the LiDAR sees can be moved: doors, bins, furniture.

    What the map shows there need not be there tomorrow. The finding gives the movable share of the length that can be seen
    at the LiDAR's height; above 20 % it is told (rules.movable_share).

    Bad:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision>
        <collision><origin xyz="2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
      <link name="shelf"><wk:object class="furniture"/>
        <collision><origin xyz="0 -1.6 1"/><geometry><box size="4 0.8 2"/></geometry></collision></link>
      <joint name="at_shelf" type="fixed"><parent link="map"/><child link="shelf"/></joint>
    Good:
      <wk:map format="1.0" scan_plane="0.3"/>
      <link name="room"><wk:object class="wall"/>
        <collision><origin xyz="0 -2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="0 2.05 1"/><geometry><box size="5.2 0.1 2"/></geometry></collision>
        <collision><origin xyz="-2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision>
        <collision><origin xyz="2.55 0 1"/><geometry><box size="0.1 4 2"/></geometry></collision></link>
      <joint name="at_room" type="fixed"><parent link="map"/><child link="room"/></joint>
      <link name="shelf"><wk:object class="column"/>
        <collision><origin xyz="0 -1.6 1"/><geometry><box size="4 0.8 2"/></geometry></collision></link>
      <joint name="at_shelf" type="fixed"><parent link="map"/><child link="shelf"/></joint>
    """
    found = context.once(seen)
    if found is None or found.movable_share <= context.tolerances.movable_share:
        return
    yield Problem(
        map_spot(context),
        f"{found.movable_share:.0%} of the visible boundary can be moved ({robot_in_words(context)})",
        'mark what is bolted down: <wk:class name="furniture" movable="false">; give doors a <wk:state prior>',
        detail={"share": found.movable_share},
    )


def check_cues(context: Context) -> Iterator[Problem]:
    """Nothing but walls is seen from most places, so that classes tell nothing.

    A camera that recognises doors or toilets helps only where some are in sight at the LiDAR's height. Told when no class
    but wall is seen from more than 10 % of the floor (rules.cue_share).

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
    found, world = context.once(seen), context.once(sound_world)
    if found is None or world is None:
        return
    cues = {name: share for name, share in found.from_share.items() if name not in ("wall", "unknown")}
    if any(share > context.tolerances.cue_share for share in cues.values()):
        return
    best = max(cues, key=lambda name: cues[name], default=None)
    most = f"; the most is '{best}', from {cues[best]:.0%}" if best is not None else ""
    yield Problem(
        map_spot(context),
        f"no class but wall is seen from more than {context.tolerances.cue_share:.0%} of the floor{most} "
        f"({robot_in_words(context)})",
        "add the doors, columns and fixtures that reach the LiDAR's height",
        detail={"seen_from": found.from_share},
    )


RULES = (
    Rule("WK-L006", "warning", check_glass),
    Rule("WK-L009", "warning", check_movable),
    Rule("WK-L014", "info", check_cues),
)
