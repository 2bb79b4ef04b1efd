"""What a plane shows of a map: in, above, below, between; closed floor; what a tilt changes; and the L rules built on it."""

from __future__ import annotations

import pytest

from tests.maps.drawn import LOCALISABILITY, box, placed, ring, robot, wall
from wallkit.maps.plane import view_at
from wallkit.maps.read import read_map
from wallkit.maps.rules import validate
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.xml import parse

HEAD = '<wk:map format="1.0" units="m rad" scan_plane="{}"/>'
ROOM = ring("r", 0, 0, 4, 3)


def view(*pieces, z=0.3, wobble=0.05):
    return view_at(read_map(parse(robot(*pieces))), z, wobble_m=wobble)


def codes(*pieces, plane="0.30", select="L", **tolerances):
    report = validate(
        robot(HEAD.format(plane), *pieces), Tolerances(**tolerances), select=[select], ignore=LOCALISABILITY
    )
    assert report.skipped == (), [str(f) for f in validate(robot(HEAD.format(plane), *pieces)).findings]
    return sorted({f.code for f in report.findings})


def bench(low, high):
    return box("bench", f"1 0.4 {high - low:.6g}", at=f"0 0 {(low + high) / 2:.6g}", wk_class="furniture") + placed(
        "bench", "2 1.5 0"
    )


@pytest.mark.parametrize(
    ("low", "high", "sight", "changes"),
    [
        (0.0, 0.4, "in", ()),
        (0.0, 0.33, "in", (0.33,)),
        (0.0, 0.3, "below", (0.3,)),
        (0.3, 0.9, "in", (0.3,)),
        (0.34, 0.9, "above", (0.34,)),
        (0.36, 0.9, "above", ()),
        (0.0, 0.24, "below", ()),
    ],
)
def test_an_element_is_in_the_plane_above_or_below_it(low, high, sight, changes):
    (element,) = (e for e in view(*ROOM, bench(low, high)).elements if e.link == "bench")
    assert element.sight == sight
    assert element.changes == pytest.approx(changes)
    assert element.z_m == (pytest.approx((low, high)),)


def test_a_plane_may_pass_between_the_parts_of_an_element_and_touching_parts_are_one():
    parts = (
        f'<collision><origin xyz="0 0 {z}"/><geometry><box size="0.3 0.3 0.2"/></geometry></collision>'
        for z in (0.1, 0.6, 0.8)
    )
    shelf = f'<link name="shelf"><wk:object class="furniture"/>{"".join(parts)}</link>' + placed("shelf", "2 1 0")
    (element,) = (e for e in view(*ROOM, shelf).elements if e.link == "shelf")
    assert element.sight == "between"
    assert element.z_m == (pytest.approx((0.0, 0.2)), pytest.approx((0.5, 0.9)))
    assert codes(*ROOM, shelf) == ["WK-L001"]


def test_closed_floor_has_the_room_s_area_less_what_stands_in_it():
    (room,) = view(*ROOM).closed
    assert room.area_m2 == pytest.approx(3.9 * 2.9)
    (furnished,) = view(*ROOM, bench(0, 0.4)).closed
    assert furnished.area_m2 == pytest.approx(3.9 * 2.9 - 0.4)
    assert view(*ROOM, z=3.0).closed == ()


def test_a_sill_within_the_wobble_joins_two_rooms_and_one_beyond_does_not():
    def hatch(sill):
        low = f'<collision><origin xyz="0.5 0 {sill / 2}"/><geometry><box size="1 0.1 {sill}"/></geometry></collision>'
        sides = wall("mid", (2, 1), (2, 3))
        below = f'<link name="low"><wk:object class="wall"/>{low}</link>' + placed("low", "2 0 0", "0 0 1.570796327")
        return sides + below

    crossing = view(*ROOM, hatch(0.32))
    assert crossing.regions_change
    assert [count for _, count in crossing.open_counts] == [2, 2, 1]
    assert not view(*ROOM, hatch(0.4)).regions_change
    assert "WK-L013" in codes(*ROOM, hatch(0.32))
    assert "WK-L013" not in codes(*ROOM, hatch(0.4))


# --------------------------------------------------------------------------------------------------- rules of group L


def test_a_room_cut_in_its_middle_raises_nothing():
    assert codes(*ROOM) == []


def test_a_plane_above_everything_or_off_the_calibration_is_an_error():
    assert codes(*ROOM, plane="2.6") == ["WK-L001", "WK-L002"]
    assert codes(*ROOM, scan_plane_m=0.34) == []
    assert codes(*ROOM, scan_plane_m=0.36) == ["WK-L002"]


@pytest.mark.parametrize(("thickness", "found"), [(0.04, ["WK-L011"]), (0.05, []), (0.19, []), (0.31, ["WK-L005"])])
def test_walls_are_measured_in_cells(thickness, found):
    assert codes(wall("a", (0, 0), (4, 0), thickness)) == found
    # with cells half as large, limits are half as far
    assert codes(wall("a", (0, 0), (4, 0), thickness / 2), cell_m=0.025) == found


@pytest.mark.parametrize(("width", "found"), [(0.008, False), (0.03, True), (0.09, True), (0.11, False)])
def test_a_way_of_less_than_two_cells_is_told_where_it_is(width, found):
    declared = f'<wk:opening id="o" kind="passage" along="1.5 {1.5 + width:.6g}" z="0 2.5"/>'
    boxes = (
        '<collision><origin xyz="0.75 0 1.25"/><geometry><box size="1.5 0.1 2.5"/></geometry></collision>'
        f'<collision><origin xyz="{(1.5 + width + 3) / 2:.6g} 0 1.25"/>'
        f'<geometry><box size="{1.5 - width:.6g} 0.1 2.5"/></geometry></collision>'
    )
    hole = f'<link name="mid"><wk:object class="wall"/>{declared}{boxes}</link>' + placed(
        "mid", "2 0 0", "0 0 1.570796327"
    )
    report = validate(robot(HEAD.format("0.30"), *ROOM, hole), select=["L012"])
    assert report.skipped == ()
    assert len(report.findings) == found
    if found:
        (finding,) = report.findings
        assert finding.xyz == pytest.approx((2.0, 1.5 + width / 2), abs=0.02)
        assert f"'o' of 'mid' is {width * 100:.2g} cm wide" in finding.message


def test_a_mirror_before_a_room_has_a_phantom_and_one_before_the_street_has_none():
    rooms = [*ring("a", 0, 0, 4, 3), wall("n", (0, 6), (4, 6)), wall("w", (0, 3), (0, 6)), wall("e", (4, 3), (4, 6))]
    glass = box("mirror", "0.006 1.2 2", at="0.003 0 1", wk_class="mirror")
    inner = glass + placed("mirror", "2 3.05 0", "0 0 1.570796327", parent="map")
    outer = glass + placed("mirror", "2 0.05 0", "0 0 1.570796327", parent="map")
    assert codes(*rooms, inner, select="L007") == ["WK-L007"]
    assert codes(*rooms, outer, select="L007") == []


@pytest.mark.parametrize(("y", "radius", "severity"), [(0.0, None, "error"), (0.2, None, None), (0.2, 0.3, "warning")])
def test_a_start_stands_on_free_floor(y, radius, severity):
    start = '<link name="start_1"/>' + placed("start_1", f"2 {y} 0")
    report = validate(robot(HEAD.format("0.3"), *ROOM, start), Tolerances(robot_radius_m=radius), select=["L010"])
    assert [f.severity for f in report.findings] == ([severity] if severity else [])
