"""Rules C without labels: unknown and missing classes with their repairs, the class table, and what moves."""

from __future__ import annotations

import pytest

from tests.maps.drawn import box, placed, robot
from wallkit.maps.document import apply_edits
from wallkit.maps.rules import validate

TABLE = '<wk:map format="1.0" units="m rad">{}</wk:map>'


def found(*pieces, rows=""):
    return list(validate(robot(TABLE.format(rows), *pieces), select=["C"]).findings)


def codes(*pieces, rows=""):
    return [(f.code, f.severity) for f in found(*pieces, rows=rows)]


def test_a_class_is_known_by_the_taxonomy_or_by_the_map():
    lift = [box("lift", "2 0.1 2.5", wk_class="lift_door"), placed("lift", "0 0 0")]
    (finding,) = found(*lift)
    assert (finding.code, finding.severity) == ("WK-C001", "error")
    assert codes(*lift, rows='<wk:class name="lift_door"/>') == []


@pytest.mark.parametrize(("written", "meant"), [("urinals", "urinal"), ("Wall", "wall"), ("windw", "window")])
def test_the_nearest_class_is_the_repair(written, meant):
    data = robot(TABLE.format(""), box("a", "1 1 1", wk_class=written), placed("a", "0 0 0"))
    (finding,) = validate(data, select=["C001"]).findings
    assert apply_edits(data, finding.fix.edits) == data.replace(f'"{written}"'.encode(), f'"{meant}"'.encode())


def test_a_missing_class_is_written_from_the_name_and_a_name_that_tells_nothing_has_no_repair():
    bare = '<link name="{}"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'
    for name, guess in (("sink_1", "sink"), ("thing_7", None)):
        data = robot(TABLE.format(""), bare.format(name), placed(name, "0 0 0"))
        (finding,) = validate(data, select=["C002"]).findings
        if guess is None:
            assert finding.fix is None
            continue
        repaired = apply_edits(data, finding.fix.edits)
        assert f'<link name="{name}"><wk:object class="{guess}"/><collision>'.encode() in repaired
        assert validate(repaired, select=["C"]).findings == ()


def test_a_plain_urdf_is_told_of_its_classes_as_information():
    shape = '<collision><geometry><box size="4 .1 2"/></geometry></collision>'
    plain = f'<robot name="t"><link name="wall_1">{shape}</link></robot>'.encode()
    (finding,) = validate(plain, select=["C"]).findings
    assert (finding.code, finding.severity, finding.fix) == ("WK-C002", "info", None)


def test_ids_are_shared_only_on_purpose():
    rows = '<wk:class name="a" seg="1 7"{}/><wk:class name="b" seg="7"{}/>'
    assert codes(rows=rows.format("", "")) == [("WK-C003", "error")]
    assert codes(rows=rows.format(' merge="true"', "")) == [("WK-C003", "error")]
    assert codes(rows=rows.format(' merge="true"', ' merge="true"')) == []
    assert codes(rows='<wk:class name="a"/><wk:class name="a"/>') == [("WK-C003", "error")]


@pytest.mark.parametrize(
    ("row", "is_told"),
    [
        ('name="glass" lidar="glass"', True),
        ('name="glass" lidar="glass" p_return="0.1"', False),
        ('name="stall" lidar="perforated"', True),
        ('name="mirror"', True),
        ('name="mirror" lidar="mirror"', False),
        ('name="window"', True),
        ('name="window" lidar="opaque"', False),
        ('name="wall"', False),
    ],
)
def test_what_is_seen_through_says_how_much(row, is_told):
    assert codes(rows=f"<wk:class {row}/>") == ([("WK-C005", "warning")] if is_told else [])


def hung(name, kind):
    return (
        f'<joint name="j" type="{kind}"><parent link="map"/><child link="{name}"/><axis xyz="0 0 1"/>'
        '<limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
    )


@pytest.mark.parametrize(
    ("wk_class", "kind", "is_told"),
    [
        ("door", "fixed", True),
        ("door", "revolute", False),
        ("trash", "fixed", False),
        ("furniture", "prismatic", False),
        ("wall", "revolute", True),
        ("toilet", "prismatic", True),
        ("unknown", "revolute", False),
    ],
)
def test_doors_move_and_walls_stay(wk_class, kind, is_told):
    told = codes(box("a", "1 1 1", wk_class=wk_class), hung("a", kind))
    assert told == ([("WK-C007", "warning")] if is_told else [])


def test_what_hangs_on_a_door_moves_with_it():
    leaf = box("leaf", "0.9 0.04 2", wk_class="door") + hung("leaf", "revolute")
    pane = box("pane", "0.5 0.04 1", wk_class="door") + placed("pane", "0 0 0", parent="leaf")
    assert codes(leaf, pane) == []
