"""Rules E, O and T: every malformed file, repairs that lead back to the sound map, thresholds, closed forms, invariances."""

from __future__ import annotations

import json
import math
import random
import re

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.maps.drawn import box, many_walls, placed, ring, robot, wall
from wallkit.maps.document import apply_edits
from wallkit.maps.numbers import meant_angle
from wallkit.maps.rules import validate
from wallkit.maps.rules.solids import penetration
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse

HEAD = '<wk:map format="1.0" units="m rad" scan_plane="0.30">{}</wk:map>'
LIMIT = '<limit lower="0" upper="1.5708" effort="1" velocity="1"/>'


def found(data, code=None, **options):
    return [f for f in validate(data, **options).findings if code is None or f.code == code]


def codes(data, severity=None, **options):
    return sorted({f.code for f in validate(data, **options).findings if severity in (None, f.severity)})


def door_wall(name, hole, *, height=2.1, leaf="", z=2.5, length=4.0, fill="door_a", thickness=0.1):
    """A wall of 4 m with a door's hole, and what hangs on it."""
    x0, x1 = hole
    boxes = [
        f'<collision><origin xyz="{(a + b) / 2:.6g} 0 {(low + high) / 2:.6g}"/>'
        f'<geometry><box size="{b - a:.6g} {thickness} {high - low:.6g}"/></geometry></collision>'
        for a, b, low, high in ((0, x0, 0, z), (x1, length, 0, z), (x0, x1, height, z))
    ]
    said = f' fill="{fill}"' if fill else ""
    opening = f'<wk:opening id="d1" kind="door" along="{x0} {x1}" z="0 {height}"{said}/>'
    return [f'<link name="{name}"><wk:object class="wall"/>{opening}{"".join(boxes)}</link>', leaf]


def leaf(size="0.88 0.04 2.08", at="0.44 -0.02 1.05", hinge="1.01 0.05 0", *, parent, more="", limit=LIMIT):
    body = box("door_a", size, at=at, wk_class="door")
    joint = (
        f'<joint name="hinge" type="revolute"><parent link="{parent}"/><child link="door_a"/><origin xyz="{hinge}"/>'
        f'<axis xyz="0 0 1"/>{limit}<wk:state rest="0" prior="closed:1"/>{more}</joint>'
    )
    return body + joint


def two_rooms(*more, middle=None, rooms=True):
    """Two rooms of 4 x 3 m, the wall between them with a door, floors drawn along the faces."""
    floors = (
        '<wk:room id="west" kind="corridor" floor="0.05 0.05  3.95 0.05  3.95 2.95  0.05 2.95"/>'
        '<wk:room id="east" floor="4.05 0.05  7.95 0.05  7.95 2.95  4.05 2.95"/>'
    )
    between = middle or [
        *door_wall("between", (1.0, 1.9), leaf=leaf(parent="between"), length=3.0),
        placed("between", "4 0 0", "0 0 1.5707963"),
    ]
    return robot(HEAD.format(floors if rooms else ""), *ring("r", 0, 0, 8, 3), *between, *more)


# ------------------------------------------------------------------------------------------- real files


def cases(data):
    folder = data / "maps/malformed"
    return [
        (folder / case["file"], set(case["expect"]))
        for case in json.loads((folder / "manifest.json").read_text())["cases"]
    ]


@pytest.mark.data
def test_the_example_is_clean(data):
    report = validate(data / "maps/wkmap_example/restroom.wkmap.urdf", select=["X", "S", "G", "E", "O", "T"])
    assert report.findings == ()
    assert report.skipped == ()


@pytest.mark.data
@pytest.mark.parametrize(
    "mutant",
    [
        *("gap_at_corner", "wall_mm_not_m", "fixture_floats_off_wall", "cut_without_opening", "door_hits_jamb"),
        *("door_limit_degrees", "door_connects_unknown_room", "rounded_right_angle"),
    ],
)
def test_the_repair_of_a_mutant_leads_back_to_a_clean_map(data, mutant):
    file = data / f"maps/malformed/mutants/{mutant}.wkmap.urdf"
    edits = [edit for f in found(file) if f.fix is not None and f.code[3] in "EOT" for edit in f.fix.edits]
    assert found(apply_edits(file.read_bytes(), edits), select=["X", "S", "G", "E", "O", "T"]) == []


def turned(text: str) -> str:
    """The same map, moved by (12, -7) and turned by 0.7 rad: a frame between, and the rooms' corners."""
    c, s = math.cos(0.7), math.sin(0.7)

    def room(match):
        xy = np.array(match[1].split(), dtype=float).reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + [12, -7]
        return f'floor="{" ".join(f"{value:.9f}" for value in xy.ravel())}"'

    text = re.sub(r'floor="([^"]*)"', room, text.replace('<parent link="map"/>', '<parent link="base"/>'))
    return text.replace("</robot>", f'<link name="base"/>{placed("base", "12 -7 0", "0 0 0.7")}</robot>')


@pytest.mark.data
def test_moving_and_turning_the_whole_map_changes_no_finding(data):
    compared = 0
    for file, _ in cases(data):
        if "mutants" not in file.parts:
            continue
        plain, moved = (
            [(f.code, f.severity, f.xpath) for f in found(text.encode(), select=["E", "O", "T"])]
            for text in (file.read_text(), turned(file.read_text()))
        )
        assert moved == plain, file.name
        compared += len(plain)
    assert compared > 40


@pytest.mark.data
def test_the_order_of_links_and_joints_changes_no_finding(data):
    for file, _ in cases(data):
        if "mutants" in file.parts:
            data_bytes = file.read_bytes()
            spans = [e.span for e in parse(data_bytes).root.children if e.name in ("link", "joint")]
            pieces = [data_bytes[span.offset : span.end] for span in reversed(spans)]
            mixed = b"\n".join([data_bytes[: spans[0].offset], *pieces, b"</robot>"])
            plain, other = (
                sorted((f.code, f.severity) for f in found(t, select=["E", "O", "T"])) for t in (data_bytes, mixed)
            )
            assert other == plain, file.name


@pytest.mark.data
def test_the_apartment_has_rounded_angles_and_nothing_worse(data):
    file = data / "maps/urdf_maps/iai_apartment/apartment.urdf"
    report = validate(file, select=["E", "O", "T"])
    assert report.count("error") == 0
    # two boxes of the wardrobe are one, shelves and one room's walls are 3 mm sheets
    assert {f.code for f in report.findings if f.severity == "warning"} == {"WK-E003", "WK-E014", "WK-E030"}


# -------------------------------------------------------------------------------------- any slip, speed


@pytest.mark.long
@settings(max_examples=120, deadline=None)
@given(st.integers(0, 2**31))
def test_no_slips_in_the_numbers_make_the_rules_raise(seed):
    rng = random.Random(seed)
    text = two_rooms().decode()
    numbers = list(re.finditer(r'(?<=[" ])-?[0-9]+(\.[0-9]+)?(?=[" ])', text))
    for match in sorted(rng.sample(numbers, rng.randint(1, 4)), key=lambda match: -match.start()):
        value = float(match[0])
        slips = ["0", "90", "1.57", "1e-9", f"{-value:g}", f"{1000 * value:g}", f"{value + rng.uniform(-1, 1):.3f}"]
        text = text[: match.start()] + rng.choice(slips) + text[match.end() :]
    for finding in found(text.encode()):
        assert all(math.isfinite(value) for value in finding.xyz)
        if finding.fix is not None:
            apply_edits(text.encode(), finding.fix.edits)


def test_a_thousand_walls_raise_nothing():
    report = validate(many_walls(1000), select=["E", "O", "T"])
    assert report.findings == ()
    assert report.skipped == ()


# ---------------------------------------------------------------------------------------------- E: walls


@pytest.mark.parametrize(("gap", "is_gap"), [(0.0005, False), (0.002, True), (0.05, True), (0.29, True), (0.31, False)])
def test_a_corner_leaks_between_one_and_three_hundred_millimetres(gap, is_gap):
    walls = [*ring("r", 0, 0, 4, 3)[1:], wall("r_s", (0.05 + gap, 0), (4.05, 0))]
    findings = found(robot(*walls), "WK-E020")
    assert bool(findings) == is_gap
    if is_gap:
        assert findings[0].severity == "error"
        assert findings[0].detail["gap_m"] == pytest.approx(gap, abs=1e-9)
        assert "the outside and 11.3 m2" in findings[0].message
        assert found(apply_edits(robot(*walls), findings[0].fix.edits), "WK-E020") == []


def test_a_gap_that_parts_nothing_is_a_warning():
    (finding,) = found(robot(wall("a", (0, 0), (3.9, 0)), wall("b", (4, -0.05), (4, 3))), "WK-E020")
    assert finding.severity == "warning"


def test_walls_of_a_cavity_are_no_gap():
    walls = [wall("outer", (0, 0), (4, 0)), wall("inner", (0.5, 0.25), (3.5, 0.25))]
    assert not set(codes(robot(*walls))) & {"WK-E020", "WK-E022"}


@pytest.mark.parametrize(("miss", "code"), [(0.0005, None), (0.01, "WK-E022"), (0.05, "WK-E022"), (0.06, "WK-E020")])
def test_a_wall_that_misses_the_middle_of_another(miss, code):
    data = robot(*ring("r", 0, 0, 4, 3), wall("stub", (2, 0.05 + miss), (2, 2.95)))
    assert set(codes(data)) & {"WK-E020", "WK-E022"} == ({code} if code else set())
    if code:
        (finding,) = found(data, code)
        assert set(codes(apply_edits(data, finding.fix.edits))) & {"WK-E020", "WK-E022"} == set()


@pytest.mark.parametrize(("offset", "is_told"), [(0.001, False), (0.01, True), (0.03, True), (0.04, False)])
def test_collinear_walls_are_in_line_or_meant_not_to_be(offset, is_told):
    data = robot(wall("a", (0, 0), (3, 0)), wall("b", (3, offset), (6, offset)))
    assert bool(found(data, "WK-E034")) == is_told


@pytest.mark.parametrize(("degrees", "is_told"), [(90, False), (90.5, True), (89.1, True), (88.5, False), (45, False)])
def test_nearly_right_angles_are_told(degrees, is_told):
    angle = math.radians(degrees)
    data = robot(wall("a", (0, 0), (4, 0)), wall("b", (2, 0), (2 + 3 * math.cos(angle), 3 * math.sin(angle))))
    assert bool(found(data, "WK-E033")) == is_told


def test_walls_cross_only_where_both_go_on():
    assert found(robot(wall("a", (0, 0), (4, 0)), wall("b", (2, -2), (2, 2))), "WK-E015")
    for b in (wall("b", (2, 0), (2, 2)), wall("b", (2, -0.2), (2, 2)), wall("b", (5, -2), (5, 2))):
        assert found(robot(wall("a", (0, 0), (4, 0)), b), "WK-E015") == []


@pytest.mark.parametrize(
    ("word", "eighths"),
    [
        *(("1.57", 2), ("-1.57", -2), ("3.14", 4), ("0.785", 1), ("0.79", 1), ("0.78", 1), ("2.36", 3), ("4.71", 6)),
        *(
            ("3.141", 4),
            ("1.571", 2),
            ("1.5708", None),
            ("1.5707963", None),
            ("1.6", None),
            ("1.50", None),
            ("0", None),
        ),
    ],
)
def test_rounded_constants_are_told_from_angles(word, eighths):
    meant = meant_angle(word)
    assert meant == (None if eighths is None else pytest.approx(eighths * math.pi / 4, abs=1e-12))


def test_a_lintel_is_no_wall_off_the_floor_and_a_low_wall_is_unseen():
    lintel = robot(box("wall_l", "1 0.1 0.4", at="0 0 2.3"), placed("wall_l", "0 0 0"))
    assert found(lintel, "WK-E021") == []
    low = robot(HEAD.format(""), box("wall_l", "4 0.1 0.2", at="0 0 0.1"), placed("wall_l", "0 0 0"))
    (finding,) = found(low, "WK-E021")
    assert "the LiDAR at 0.3 m does not see it" in finding.message


# ------------------------------------------------------------------------------------------- E: fixtures


@settings(max_examples=60, deadline=None)
@given(st.floats(0, math.pi), st.floats(-1.2, 1.2), st.floats(-1.2, 1.2))
def test_the_penetration_of_two_boxes_is_the_least_way_out(angle, x, y):
    a = shapely.affinity.translate(
        shapely.affinity.rotate(shapely.box(-0.5, -0.3, 0.5, 0.3), angle, use_radians=True), x, y
    )
    b = shapely.box(-0.6, -0.4, 0.6, 0.4)
    depth, way = penetration(a, b)
    assert (depth > 1e-9) == (a.intersection(b).area > 1e-12) or depth < 1e-6
    if depth > 1e-6:
        assert np.hypot(*way) == pytest.approx(1)
        out = shapely.affinity.translate(a, *(way * (depth + 1e-9)))
        assert out.intersection(b).area < 1e-9
        for turn in np.linspace(0, 2 * math.pi, 24):
            less = shapely.affinity.translate(a, 0.98 * depth * math.cos(turn), 0.98 * depth * math.sin(turn))
            assert less.intersects(b)


@pytest.mark.parametrize(
    ("y", "code"), [(0.04, "WK-E010"), (0.047, None), (0.05, None), (0.069, None), (0.08, "WK-E012")]
)
def test_a_sink_touches_its_wall(y, code):
    sink = box("sink_1", "0.4 0.5 0.2", at="0.2 0 0.8", wk_class="sink")
    data = robot(wall("w", (0, 0), (4, 0)), sink, placed("sink_1", f"2 {y} 0", "0 0 1.5707963"))
    assert set(codes(data)) & {"WK-E010", "WK-E012"} == ({code} if code else set())
    if code:
        edits = found(data, code)[0].fix.edits
        assert re.search(rb'xyz="2 0.05 0"', apply_edits(data, edits))


def test_drawers_may_stand_in_their_cabinet_but_not_in_another():
    cabinet = [box("cabinet", "1 0.6 1", wk_class="furniture"), placed("cabinet", "0 0 0.5")]
    drawer = box("drawer", "0.9 0.5 0.2", wk_class="furniture")
    assert found(robot(*cabinet, drawer, placed("drawer", "0 0 0", parent="cabinet")), "WK-E011") == []
    (finding,) = found(robot(*cabinet, drawer, placed("drawer", "0.8 0 0.5")), "WK-E011")
    assert "stand 150 mm in each other" in finding.message


def test_an_element_pasted_twice_is_deleted_whole():
    data = robot(*ring("r", 0, 0, 4, 3), wall("again", (-0.05, 0), (4.05, 0)))
    (finding,) = found(data, "WK-E014")
    assert apply_edits(data, finding.fix.edits).count(b"again") == 0


# ---------------------------------------------------------------------------------------------- E: scale


@pytest.mark.parametrize(("factor", "unit"), [(1000, "millimetres"), (100, "centimetres"), (39.3700787, "inches")])
def test_another_unit_flips_only_the_scale_of_the_whole_map(factor, unit):
    def scaled(match):
        return f'{match[1]}="{" ".join(f"{float(word) * factor:.6f}" for word in match[2].split())}"'

    text = re.sub(r'(size|xyz(?=="[^"]*" rpy|="[^"]*"/><geometry))="([^"]*)"', scaled, two_rooms(rooms=False).decode())
    findings = found(text.encode(), select=["E"])
    assert [f.code for f in findings] == ["WK-E041"]
    assert unit in findings[0].message


def test_one_long_corridor_is_not_in_millimetres():
    walls = [wall("long", (0, 0), (120, 0)), *(wall(f"w{k}", (3 * k, 0.05), (3 * k, 1)) for k in range(30))]
    assert found(robot(*walls), "WK-E040") == []


# -------------------------------------------------------------------------------------- O: holes, leaves


def test_a_sound_pair_of_rooms_has_no_finding():
    assert found(two_rooms(), select=["X", "S", "G", "E", "O", "T"]) == []


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (('along="1.0 1.9"', 'along="1.0 2.0"'), "WK-O001"),
        (('along="1.0 1.9"', 'along="1.0 3.5"'), "WK-O002"),
        (('along="1.0 1.9"', 'along="1.9 1.0"'), "WK-O002"),
        (("0.88 0.04 2.08", "0.98 0.04 2.08"), "WK-O003"),
        (("0.88 0.04 2.08", "0.88 0.04 2.28"), "WK-O004"),
        (('fill="door_a"', 'fill="door_b"'), "WK-O007"),
        (('upper="1.5708"', 'upper="90"'), "WK-O012"),
        (('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>'), "WK-O013"),
        (('rest="0"', 'rest="1.6"'), "WK-O014"),
        (('"closed:1"', '"closed:0.5 ajar:0.5"'), "WK-O015"),
        (('"closed:1"', '"closed:1.5 open:-0.5"'), "WK-O015"),
    ],
)
def test_one_slip_in_a_door_is_one_error(change, code):
    text = two_rooms().decode()
    assert change[0] in text
    assert codes(text.replace(*change).encode(), "error", select=["E", "O", "T"]) == [code]


@pytest.mark.parametrize("side", [1, -1])
def test_a_hinge_in_the_walls_middle_hits_the_jamb_where_geometry_says(side):
    limit = LIMIT if side > 0 else '<limit lower="-1.5708" upper="0" effort="1" velocity="1"/>'
    bad = leaf(at="0.45 0 1.05", hinge="1.0 0 0", parent="between", limit=limit)
    middle = [*door_wall("between", (1.0, 1.9), leaf=bad, length=3.0), placed("between", "4 0 0", "0 0 1.5707963")]
    data = two_rooms(middle=middle)
    (finding,) = found(data, "WK-O010")
    # the leaf's corner (0.01, 0.02) passes x = 0 at tan(q) = 0.5; a square millimetre of overlap comes a little later
    first = math.atan(0.5)
    assert first < side * finding.detail["state"] < first + 0.06
    assert finding.detail["overlap_m2"] == pytest.approx(0.02 * 0.04, rel=0.5)
    assert codes(apply_edits(data, finding.fix.edits), select=["E", "O", "T"]) == []


def test_a_hole_is_declared_with_the_door_that_stands_in_it():
    text = two_rooms().decode()
    opening = re.search(r"<wk:opening[^>]*/>", text)[0]
    (finding,) = found(text.replace(opening, "").encode(), "WK-O006")
    repaired = apply_edits(text.replace(opening, "").encode(), finding.fix.edits)
    assert b'kind="door" along="1 1.9" z="0 2.1" fill="door_a"' in repaired
    assert found(repaired, select=["E", "O", "T"]) == []


def test_a_lintel_may_be_all_there_is_of_an_openings_wall():
    opening = '<wk:opening id="d" kind="passage" along="0 1" z="0 2.1"/>'
    data = robot(box("over", "1 0.1 0.4", at="0.5 0 2.3", more=opening), placed("over", "0 0 0"))
    assert not set(codes(data)) & {"WK-O001", "WK-O002", "WK-O006"}


def test_a_step_in_a_walls_top_is_no_hole():
    low = '<collision><origin xyz="3.5 0 0.5"/><geometry><box size="1 0.1 1"/></geometry></collision>'
    data = robot(box("w", "3 0.1 2.5", at="1.5 0 1.25").replace("</link>", f"{low}</link>"), placed("w", "0 0 0"))
    assert found(data, "WK-O006") == []


def test_a_robot_fits_through_what_the_open_leaf_leaves():
    # of 0.9 m the leaf, standing at a right angle before the left jamb, takes 0.01 m and its thickness
    clear = 0.9 - 0.01 - 0.04
    for radius, fits in (((clear - 0.1) / 2 - 0.002, True), ((clear - 0.1) / 2 + 0.002, False)):
        findings = found(two_rooms(), "WK-O020", tolerances=Tolerances(robot_radius_m=radius))
        assert (findings == []) == fits
        if not fits:
            assert findings[0].detail["clear_m"] == pytest.approx(clear, abs=1e-3)


# ---------------------------------------------------------------------------------------------- T: rooms


def test_a_room_without_an_opening_is_unreachable_and_has_no_door():
    data = two_rooms(middle=[wall("between", (4, 0), (4, 3))])
    (finding,) = found(data, "WK-T001")
    assert "'east'" in finding.message
    assert set(finding.detail["walls"]) == {"r_s", "r_n", "r_e", "between"}
    assert len(found(data, "WK-T008")) == 2


@pytest.mark.parametrize("width", [0.05, 0.12, 0.2, 0.45])
def test_a_leak_is_found_where_it_is_and_as_wide_as_it_is(width):
    # a hatch at floor level that nobody declared; the wall goes on above it
    pieces = door_wall("between", (1.5 - width / 2, 1.5 + width / 2), height=1.0, length=3.0, fill="")
    undeclared = [re.sub("<wk:opening[^>]*/>", "", pieces[0]), placed("between", "4 0 0", "0 0 1.5707963")]
    (finding,) = found(two_rooms(middle=undeclared), "WK-T007")
    assert finding.severity == "error"
    assert "room 'east' leaks into room 'west'" in finding.message
    assert finding.xyz == pytest.approx((4.0, 1.5), abs=0.02)
    assert finding.detail["gap_m"] == pytest.approx(width, rel=0.1)


def test_the_outside_leaks_in_as_well():
    walls = [*ring("r", 0, 0, 8, 3)[1:], *door_wall("south", (2.0, 2.2), height=1.0, length=8.0, fill="")]
    south = re.sub("<wk:opening[^>]*/>", "", walls[3])
    floor = '<wk:room id="hall" floor="0.05 0.05  7.95 0.05  7.95 2.95  0.05 2.95"/>'
    (finding,) = found(robot(HEAD.format(floor), *walls[:3], south, placed("south", "0 0 0")), "WK-T007")
    assert "room 'hall' leaks into the outside" in finding.message
    assert finding.xyz == pytest.approx((2.1, 0.0), abs=0.02)


def test_an_open_side_is_no_leak():
    assert found(two_rooms(middle=[wall("between", (4, 0), (4, 1))]), "WK-T007") == []


def test_floors_are_turned_and_closed_by_their_repair():
    floor = 'floor="0.05 0.05  3.95 0.05  3.95 2.95  0.05 2.95"'
    clockwise = two_rooms().decode().replace(floor, 'floor="0.05 2.95  3.95 2.95  3.95 0.05  0.05 0.05  0.05 2.95"')
    (finding,) = found(clockwise.encode(), "WK-T002")
    assert "runs clockwise and repeats its first corner" in finding.message
    assert apply_edits(clockwise.encode(), finding.fix.edits) == two_rooms()


def test_rooms_that_disagree_with_the_walls_are_told():
    text = two_rooms().decode()
    east = "4.05 0.05  7.95 0.05  7.95 2.95  4.05 2.95"
    through = text.replace(east, "3.2 0.05  7.95 0.05  7.95 2.95  3.2 2.95")
    assert codes(through.encode(), "error") == ["WK-T003"]
    small = text.replace(east, "4.05 0.05  7.5 0.05  7.5 2.95  4.05 2.95")
    assert codes(small.encode(), "warning") == ["WK-T011"]


def test_a_door_says_what_it_stands_between():
    text = two_rooms().decode().replace('class="door"', 'class="door" connects="west outside"')
    (finding,) = found(text.encode(), "WK-T006")
    repaired = apply_edits(text.encode(), finding.fix.edits)
    assert re.search(rb'connects="(west east|east west)"', repaired)
    assert found(repaired, select=["E", "O", "T"]) == []


def test_fixtures_are_looked_for_in_rooms():
    toilet = box("toilet_1", "0.6 0.4 0.4", at="0.3 0 0.2", wk_class="toilet")
    for xyz, code in (("0.05 0.6 0", "WK-T010"), ("4.05 0.6 0", None), ("8.05 0.6 0", "WK-T009")):
        data = two_rooms(toilet, placed("toilet_1", xyz))
        assert set(codes(data)) & {"WK-T009", "WK-T010"} == ({code} if code else set())
