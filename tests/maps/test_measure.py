"""Measures: closed forms on drawn walls, and the same after the whole map is turned."""

from __future__ import annotations

import math

import pytest

from tests.maps.drawn import box, placed, robot, wall
from wallkit.errors import MapError
from wallkit.maps.measure import extent_of, measure
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse

HEADER = '<wk:map format="1.0" units="m rad"><wk:room id="r" floor="0 0.05  4 0.05  4 1.95  0 1.95"/></wk:map>'
DOOR = (
    '<link name="w"><wk:object class="wall"/><wk:opening id="d" kind="door" along="1 1.9" z="0 2.1" fill="leaf"/>'
    '<collision><origin xyz="0.5 0 1.25"/><geometry><box size="1 0.12 2.5"/></geometry></collision>'
    '<collision><origin xyz="2.95 0 1.25"/><geometry><box size="2.1 0.12 2.5"/></geometry></collision></link>'
    '<link name="leaf"><wk:object class="door"/><collision><origin xyz="0.44 -0.02 1.05"/>'
    '<geometry><box size="0.88 0.04 2.08"/></geometry></collision></link>'
    '<joint name="h" type="revolute"><parent link="w"/><child link="leaf"/><origin xyz="1.01 0.06 0"/>'
    '<axis xyz="0 0 1"/><limit lower="0" upper="1.570796327" effort="1" velocity="1"/></joint>'
)


def map_of(*pieces: str, turn: float = 0.0):
    """The pieces on a link that is turned and shifted against the map."""
    joint = (
        '<link name="frame"/><joint name="at_frame" type="fixed"><parent link="map"/><child link="frame"/>'
        f'<origin xyz="{3 * turn} {-turn} 0" rpy="0 0 {turn}"/></joint>'
    )
    text = robot(HEADER, *pieces).decode().replace('<parent link="map"/>', '<parent link="frame"/>')
    return read_map(parse(text.replace("</robot>", joint + "</robot>").encode()))


PIECES = (
    wall("a", (0, 0), (4, 0)),
    wall("b", (1, 2), (6, 2)),
    wall("c", (5, 0), (5, 1)),
    box("cup", "0.2 0.2 0.2", at="0 0 0.1", wk_class="unknown"),
    placed("cup", "2 1 3"),
)


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.1])
def test_between_parallel_walls(turn):
    """Axes 2 m apart, each 0.1 m thick; they face each other along the 3 m that both have."""
    found = measure(map_of(*PIECES, turn=turn), "a", "b")
    assert found.frames_m == pytest.approx(math.hypot(1, 2))
    assert found.surfaces_m == pytest.approx(1.9)
    assert found.clear_m == pytest.approx(1.9)
    assert found.facing_m == pytest.approx(3.0)
    assert found.angle_rad == pytest.approx(0.0, abs=1e-9)
    assert found.over_m == 0.0
    assert math.dist(*found.points_m) == pytest.approx(found.surfaces_m)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_between_crossed_walls_there_is_an_angle_and_a_gap(turn):
    found = measure(map_of(*PIECES, turn=turn), "a", "c")
    assert found.angle_rad == pytest.approx(math.pi / 2)
    assert found.surfaces_m == pytest.approx(0.95)  # from x = 4 to 5 less half of 0.1
    back = measure(map_of(*PIECES, turn=turn), "c", "a")
    assert back.angle_rad == pytest.approx(-math.pi / 2)
    assert back.surfaces_m == pytest.approx(found.surfaces_m)
    assert [-value for value in back.by_m] == pytest.approx(found.by_m)


def test_things_above_each_other_have_air_between():
    found = measure(map_of(*PIECES), "cup", "a")
    assert found.over_m == pytest.approx(0.5)  # the wall ends at 2.5, the cup starts at 3
    assert found.surfaces_m == pytest.approx(1 - 0.1 - 0.05)


def test_points_rooms_and_openings():
    semantic_map = map_of(*PIECES, DOOR, placed("w", "0 4 0"))
    assert measure(semantic_map, "1,1", "4,5").frames_m == pytest.approx(5.0)
    assert measure(semantic_map, "1,1,0", "1,1,2").frames_m == pytest.approx(2.0)
    assert measure(semantic_map, "1,3", "r").surfaces_m == pytest.approx(1.05)
    assert measure(semantic_map, "1,1", "r").surfaces_m == 0.0
    for word in ("d", "w/d", "opening:d"):
        assert measure(semantic_map, "1.45,0", word).frames_m == pytest.approx(4.0)


def test_an_opening_is_as_clear_as_its_open_leaf_leaves_it():
    """Hinged 1 cm from the jamb, the open leaf stands 4 cm thick beside it: 0.9 - 0.01 - 0.04."""
    found = extent_of(map_of(DOOR, placed("w", "0 4 0"), turn=0.4), "d")
    assert found.size_m == pytest.approx((0.9, 0.12, 2.1))
    assert found.clear_m == pytest.approx(0.85, abs=1e-6)
    passage = DOOR.partition('<link name="leaf">')[0].replace(' fill="leaf"', "")
    assert extent_of(map_of(passage, placed("w", "0 4 0")), "d").clear_m == pytest.approx(0.9)


def test_extents():
    semantic_map = map_of(*PIECES)
    room = extent_of(semantic_map, "r")
    assert room.size_m == pytest.approx((4.0, 1.9, 2.5))
    assert (room.area_m2, room.perimeter_m) == (pytest.approx(7.6), pytest.approx(11.8))
    assert room.free_m2 == pytest.approx(7.6 - 0.04)
    assert extent_of(map_of(*PIECES, turn=0.7), "b").size_m == pytest.approx((5.0, 0.1, 2.5))


@pytest.mark.parametrize("word", ["wal", "1,", "room:a", "x/d", ""])
def test_what_is_not_there_is_refused_with_the_closest(word):
    with pytest.raises(MapError) as error:
        measure(map_of(*PIECES), "a", word)
    assert "one of:" in error.value.hint
