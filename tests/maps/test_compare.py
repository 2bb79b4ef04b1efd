"""Differences: a map does not differ from itself, and one edit is one change with its own figure."""

from __future__ import annotations

import math
import re

import pytest

from tests.maps.drawn import box, placed, ring, robot
from wallkit.maps.canonical import canonical
from wallkit.maps.diff.compare import compare_maps
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse


def map_of(data: bytes):
    return read_map(parse(data))


def texts(a: bytes, b: bytes, **settings) -> list[str]:
    return [change.text for change in compare_maps(map_of(a), map_of(b), **settings)]


@pytest.fixture
def example(data) -> bytes:
    return (data / "maps/wkmap_example/restroom.wkmap.urdf").read_bytes()


EDITS = (
    # (pattern, replacement, what is said)
    (r'(child link="wall_mid"/><origin xyz="0 2.0)6', r"\g<1>92", "wall_mid moved 3.2 cm (y +0.032)"),
    (r'(child link="toilet_1"/><origin xyz="4.)9', r"\g<1>75", "toilet_1 moved 15.0 cm (y -0.150)"),
    (r'upper="1.5708"', 'upper="1.92"', "door_m: limit 1.5708 -> 1.92 rad"),
    (r"closed:0.7 open:0.2", "closed:0.6 open:0.3", "prior closed:0.7 open:0.2 unknown:0.1 -> closed:0.6 open:0.3"),
    (r'rest="0" prior', 'rest="0.5" prior', "door_m: rest 0 -> 0.5 rad"),
    (r'class="urinal"/>\s', 'class="sink"/>\n', "urinal_1: class urinal -> sink"),
    (r'p_return="0.15"', 'p_return="0.2"', "class glass: p_return 0.15 -> 0.2"),
    (r'<wk:class name="sink"[^>]*>', "", "class sink removed"),
    (r'scan_plane="0.30"', 'scan_plane="0.35"', "floor2_restroom: scan_plane 0.3 -> 0.35 m"),
    (r'north="3948811.75"', 'north="3948812"', "floor2_restroom: origin north 3948811.75 -> 3948812 m"),
    (r'id="corridor" ', 'id="hall" ', "room corridor renamed to hall"),
    (r"0 0  5 0  5 2  0 2", "0 0  5 0  5 2.1  0 2.1", "room corridor has another floor: 10.00 -> 10.50 m2"),
    (r'along="1.00 1.90"', 'along="1.00 2.00"', "wall_mid: opening d1: along 1 1.9 -> 1 2 m"),
    (
        r'size="0.32 0.35 0.60"',
        'size="0.32 0.4 0.60"',
        "urinal_1: part body: size box 0.32 x 0.35 x 0.6 -> box 0.32 x 0.4 x 0.6",
    ),
    (r'<axis xyz="0 0 1"/>', '<axis xyz="0 0 -1"/>', "door_m: axis 0 0 1 -> 0 0 -1"),
    (r'separates="corridor restroom_m"', "", "wall_mid: separates corridor restroom_m -> -"),
    (r'sigma="0.01"', 'sigma="0.02"', "wall_s: sigma 0.01 -> 0.02 m"),
    (r'(<parent link=")wall_e("/><child link="toilet_1")', r"\1wall_w\2", "toilet_1: hangs on wall_e -> wall_w"),
)


def test_a_map_does_not_differ_from_itself_however_it_is_written(example):
    assert compare_maps(map_of(example), map_of(example)) == ()
    assert texts(example, canonical(parse(example))) == []
    assert texts(example, example.replace(b"  <link", b"<!-- x --><link")) == []


@pytest.mark.parametrize(("pattern", "new", "said"), EDITS, ids=[said[:40] for *_, said in EDITS])
def test_one_edit_is_one_change(example, pattern, new, said):
    edited, count = re.subn(pattern, new, example.decode(), count=1)
    assert count == 1
    found = texts(example, edited.encode())
    assert said in found[0]
    # hanging on another wall also moves the toilet
    assert len(found) == (2 if "hangs on" in said else 1), found
    assert len(texts(edited.encode(), example)) == len(found)


def test_what_is_carried_along_is_not_named(example):
    """The door and the sink hang on wall_mid."""
    edited = example.replace(b'"wall_mid"/><origin xyz="0 2.06 0"', b'"wall_mid"/><origin xyz="0 2.06 0" rpy="0 0 0.1"')
    (change,) = compare_maps(map_of(example), map_of(edited))
    assert (change.kind, change.name) == ("moved", "wall_mid")
    assert change.text == "wall_mid turned +5.73 deg"
    assert change.detail["turned_rad"] == pytest.approx(0.1)


def test_a_rename_is_one_change_with_its_references(example):
    edited = example.replace(b'"wall_mid"', b'"divider"').replace(b'"wall_mid.', b'"divider.')
    assert texts(example, edited) == ["wall_mid renamed to divider"]


def test_added_and_removed_links_say_what_and_where(example):
    edited = example.replace(
        b"</robot>", (box("bin", "0.3 0.3 0.6", wk_class="trash") + placed("bin", "1 3 0") + "</robot>").encode()
    )
    assert texts(example, edited) == ["bin added (trash at x 1.000, y 3.000)"]
    assert texts(edited, example) == ["bin removed (trash)"]


def test_a_rigid_motion_of_everything_is_one_change(example):
    """Walls on the map link and floors of rooms, turned and shifted by hand."""
    plain = robot(
        '<wk:map format="1.0" units="m rad"><wk:room id="r" floor="0 0  4 0  4 3  0 3"/></wk:map>',
        *ring("w", 0, 0, 4, 3),
    )
    turn, shift = 0.3, (2.0, -1.0)
    c, s = math.cos(turn), math.sin(turn)

    def moved(x: float, y: float) -> tuple[float, float]:
        return c * x - s * y + shift[0], s * x + c * y + shift[1]

    def joint(match: re.Match[str]) -> str:
        x, y, yaw = (float(match[i]) for i in (1, 2, 3))
        u, v = moved(x, y)
        return f'<origin xyz="{u!r} {v!r} 0" rpy="0 0 {yaw + turn!r}"/></joint>'

    text = re.sub(r'<origin xyz="(\S+) (\S+) 0" rpy="0 0 (\S+)"/></joint>', joint, plain.decode())
    floor = "  ".join(f"{x!r} {y!r}" for x, y in (moved(*corner) for corner in ((0, 0), (4, 0), (4, 3), (0, 3))))
    text = text.replace("0 0  4 0  4 3  0 3", floor)
    (change,) = compare_maps(map_of(plain), map_of(text.encode()))
    assert change.text == "everything moved together: moved 2.236 m (x +2.000, y -1.000), turned +17.19 deg"


def test_a_child_that_stays_while_its_parent_moves_is_told_from_one_that_moved(example):
    edited = example.replace(b'"wall_e"/><origin xyz="5.06 0 0"', b'"wall_e"/><origin xyz="5.06 0.1 0"').replace(
        b'"toilet_1"/><origin xyz="4.9 ', b'"toilet_1"/><origin xyz="4.8 '
    )
    assert texts(example, edited) == [
        "wall_e moved 10.0 cm (y +0.100)",
        "toilet_1 stays where it is while wall_e moves",
    ]


def test_the_tolerance_is_what_counts_as_nothing(example):
    edited = example.replace(b'"wall_mid"/><origin xyz="0 2.06 0"', b'"wall_mid"/><origin xyz="0 2.061 0"')
    assert texts(example, edited) == ["wall_mid moved 1.0 mm (y +0.001)"]
    assert texts(example, edited, tolerance=0.002) == []


def test_every_mutant_of_the_example_differs_from_it(data, example):
    for path in sorted((data / "maps/malformed/mutants").glob("*.urdf")):
        assert texts(example, path.read_bytes()), path.name
