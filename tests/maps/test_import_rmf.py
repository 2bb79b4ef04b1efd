"""building.yaml: metres from measurements, y up, doors that swing as the editor draws them, nothing left out unsaid."""

from __future__ import annotations

import math
from collections import Counter
from contextlib import suppress

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.importers import import_map, recognise
from wallkit.maps.importers.imported import ImportOptions
from wallkit.maps.importers.rmf import read_rmf

HEADER = "coordinate_system: reference_image\n"


def vertices(points):
    return "".join(f"      - [{x}, {y}, 0, '']\n" for x, y in points)


def building(tmp_path, body, *, header=HEADER, points=((0, 0), (100, 0), (200, 0), (200, 100), (0, 100)), scale=True):
    measure = "    measurements:\n      - [0, 1, {distance: [3, 5.0]}]\n" if scale else ""
    path = tmp_path / "house.building.yaml"
    path.write_text(f"{header}levels:\n  L1:\n    elevation: 3.5\n{measure}    vertices:\n{vertices(points)}{body}")
    return path


def wall(a, b, **parameters):
    inside = ", ".join(f"{key}: [3, {value}]" for key, value in parameters.items())
    return f"      - [{a}, {b}, {{{inside}}}]\n"


def door(a, b, kind="hinged", axis="start", direction=1, degrees=90):
    return (
        f"      - [{a}, {b}, {{motion_axis: [1, {axis}], motion_degrees: [3, {degrees}], "
        f"motion_direction: [2, {direction}], name: [1, d], type: [1, {kind}]}}]\n"
    )


def read(path, **options):
    return read_rmf(path, ImportOptions(**options))


def said(imported, code):
    return [note for note in imported.notes if note.code == code]


def test_pixels_become_metres_and_down_becomes_up(tmp_path):
    imported = read(building(tmp_path, "    walls:\n" + wall(1, 3, texture_height=2.8)))
    (draft,) = imported.drafts
    (only,) = draft.walls
    # 100 px are 5 m
    assert only.start == pytest.approx((5.0, 0.0))
    assert only.end == pytest.approx((10.0, -5.0))
    assert (only.height_m, only.thickness_m) == (2.8, 0.1)
    assert (draft.level, draft.elevation_m) == ("L1", 3.5)


def test_the_scale_is_the_mean_ratio_and_its_spread_is_said(tmp_path):
    body = "    measurements:\n      - [0, 1, {distance: [3, 5.0]}]\n      - [1, 2, {distance: [3, 5.1]}]\n"
    imported = read(building(tmp_path, body + "    walls:\n" + wall(0, 2), scale=False))
    assert imported.drafts[0].walls[0].length_m == pytest.approx(200 * 0.0505)
    assert "2 measurements agree to 2.0%" in said(imported, "import.read")[0].message


@pytest.mark.parametrize(
    ("axis", "direction", "hinge", "opens_to"),
    # an image's y points down, so +1 turns clockwise seen from above: to the right of start -> end from the start ...
    [
        ("start", 1, "start", "right"),
        ("start", -1, "start", "left"),
        ("end", 1, "end", "left"),
        ("end", -1, "end", "right"),
    ],
)
def test_a_door_swings_as_the_editor_draws_it(tmp_path, axis, direction, hinge, opens_to):
    (draft,) = read(building(tmp_path, "    doors:\n" + door(0, 1, axis=axis, direction=direction, degrees=-70))).drafts
    (frame,) = draft.walls
    (opening,) = frame.openings
    assert (opening.fill.motion, opening.fill.hinge, opening.fill.side) == ("hinged", hinge, opens_to)
    assert opening.fill.travel_rad == pytest.approx(math.radians(70))
    assert opening.along == pytest.approx((0.0, frame.length_m))
    assert opening.z == (0.0, 2.2)


@pytest.mark.parametrize(
    ("kind", "motion"),
    [
        ("double_hinged", "double_hinged"),
        ("sliding", "sliding"),
        ("double_sliding", "double_sliding"),
        ("double_telescope", "double_sliding"),
    ],
)
def test_every_kind_of_door_is_read_and_telescopes_are_said_to_be_simplified(tmp_path, kind, motion):
    imported = read(building(tmp_path, "    doors:\n" + door(0, 1, kind)))
    assert imported.drafts[0].walls[0].openings[0].fill.motion == motion
    assert any("telescope" in note.message for note in imported.notes) == ("telescope" in kind)
    write_draft(imported.drafts[0])


def test_a_door_drawn_on_a_wall_is_cut_into_it_either_way_round(tmp_path):
    # the wall runs over three vertices, the door lies between two of them, drawn against the wall
    points = ((0, 0), (200, 0), (120, 0), (80, 0))
    body = "    walls:\n" + wall(0, 1) + "    doors:\n" + door(2, 3)
    (draft,) = read(building(tmp_path, body, points=points)).drafts
    (only,) = draft.walls
    (opening,) = only.openings
    assert opening.along == pytest.approx((80 / 200 * 5.0, 120 / 200 * 5.0))
    # hinge at the door's start is towards the wall's end; right of the door is left of the wall
    assert (opening.fill.hinge, opening.fill.side) == ("end", "left")


def test_a_toilet_stands_with_its_back_to_the_wall_and_furniture_is_said_to_be_left_out(tmp_path):
    models = (
        "    models:\n      - {model_name: OpenRobotics/Toilet, x: 50, y: 10, yaw: 1.0, z: 0}\n"
        "      - {model_name: OpenRobotics/Sofa, x: 50, y: 50, yaw: 0, z: 0}\n"
    )
    imported = read(building(tmp_path, "    walls:\n" + wall(0, 2) + models))
    (toilet,) = imported.drafts[0].fixtures
    assert (toilet.class_name, toilet.wall) == ("toilet", "wall_0_2")
    assert toilet.pose == pytest.approx((2.5, -0.05, -math.pi / 2))
    assert any("1 Sofa" in note.message for note in said(imported, "import.skipped"))


def test_levels_are_laid_over_each_other_by_their_fiducials(tmp_path):
    level = (
        "  {name}:\n    measurements:\n      - [0, 1, {{distance: [3, {metres}]}}]\n    vertices:\n"
        "      - [{x}, 0, 0, '']\n      - [{x2}, 0, 0, '']\n    walls:\n      - [0, 1, {{}}]\n"
        "    fiducials:\n      - [{x}, 0, one]\n      - [{x2}, 0, two]\n"
    )
    path = tmp_path / "tower.building.yaml"
    first = level.format(name="L1", x=100, x2=200, metres=5.0)
    # the same wall on a drawing of another scale and place
    second = level.format(name="L2", x=30, x2=80, metres=5.0)
    path.write_text(f"{HEADER}levels:\n{first}{second}")
    below, above = read(path).drafts
    assert above.walls[0].start == pytest.approx(below.walls[0].start)
    assert above.walls[0].end == pytest.approx(below.walls[0].end)


def test_lifts_floors_and_transparent_walls_are_said(tmp_path):
    body = "    walls:\n" + wall(0, 2, alpha=0.5) + "    floors:\n      - {vertices: [0, 1, 2]}\nlifts:\n  Lift1: {}\n"
    text = " ".join(note.message for note in read(building(tmp_path, body)).notes)
    assert "1 walls are drawn transparent" in text
    assert "1 floor polygons" in text
    assert "1 lifts (Lift1)" in text


def test_doors_of_impossible_width_speak_against_the_measurement(tmp_path):
    # somebody measured in feet: the leaf of 0.8 m comes out as 2.6
    points = ((0, 0), (100, 0), (200, 0), (216, 0))
    body = "    measurements:\n      - [0, 1, {distance: [3, 16.4]}]\n    doors:\n" + door(2, 3)
    imported = read(building(tmp_path, body, points=points, scale=False))
    (finding,) = said(imported, "WK-E041")
    assert "looks drawn in feet" in finding.message


@pytest.mark.parametrize(
    ("change", "says", "line"),
    [
        ({"header": "coordinate_system: wgs84\n"}, "coordinate_system is wgs84", 1),
        ({"body": "    walls:\n      - [0, 99, {}]\n"}, "names the vertex 99", 14),
        ({"body": "    walls:\n      - [0, -1, {}]\n"}, "names the vertex -1", 14),
        ({"body": "    walls:\n      - oops\n"}, "entry 0 of 'walls' is 'oops'", 14),
        ({"body": "    walls: 7\n"}, "'walls' of level 'L1' is not a list", 13),
        ({"points": ((0, 0), ("a", 1))}, "entry 1 of 'vertices'", 9),
        ({"scale": False}, "has no measurements", None),
        ({"body": "    models:\n      - {model_name: Toilet, x: here}\n"}, "model 0 has no numbers", 14),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, change, says, line):
    change = {"body": "    walls:\n" + wall(0, 2), **change}
    path = building(tmp_path, **change)
    with pytest.raises(MapError) as caught:
        read(path)
    assert says in caught.value.message
    assert caught.value.hint
    if line:
        assert caught.value.where == f"{path}:{line}"


@pytest.mark.data
def test_office_has_the_known_counts_and_the_known_defects(data):
    imported = import_map(data / "maps/rmf/office.building.yaml", ImportOptions())
    (draft,) = imported.drafts
    walls = [w for w in draft.walls if not w.openings]
    assert len(walls) == 33
    assert sum(w.length_m for w in walls) == pytest.approx(92.6, abs=0.05)
    widths = sorted(w.openings[0].along[1] for w in draft.walls if w.openings)
    assert widths == pytest.approx([0.89, 0.89, 1.90], abs=0.005)
    assert [n.detail["gaps"] for n in said(imported, "WK-E020")] == [3]
    assert [n.detail["pairs"] for n in said(imported, "import.duplicates")] == [3]
    assert not said(imported, "WK-E022")
    assert not said(imported, "WK-E041")


@pytest.mark.data
def test_hotel_has_the_known_counts_on_three_levels(data):
    imported = import_map(data / "maps/rmf/hotel.building.yaml", ImportOptions())
    assert [draft.level for draft in imported.drafts] == ["L1", "L2", "L3"]
    walls = [w for draft in imported.drafts for w in draft.walls]
    fixtures = Counter(f.class_name for draft in imported.drafts for f in draft.fixtures)
    assert sum(not w.openings for w in walls) == 254
    assert sum(len(w.openings) for w in walls) == 19
    assert (fixtures["toilet"], fixtures["sink"], fixtures["shower"]) == (20, 6, 2)
    assert all(f.wall for draft in imported.drafts for f in draft.fixtures if f.class_name != "trash")
    # the lift shafts stand above each other: fiducials agree to a tenth of a metre
    assert all(n.detail["residual_m"] < 0.1 for n in said(imported, "import.read") if "residual_m" in n.detail)
    for draft in imported.drafts:
        write_draft(draft)


@pytest.mark.data
def test_campus_is_refused(data):
    path = data / "maps/rmf/campus.building.yaml"
    assert recognise(path) == "rmf"
    with pytest.raises(MapError, match="wgs84"):
        import_map(path, ImportOptions())


def test_a_broken_building_gives_a_reason_and_never_a_traceback(tmp_path):
    rng = np.random.default_rng(5)
    good = building(tmp_path, "    walls:\n" + wall(0, 2) + "    doors:\n" + door(0, 1)).read_bytes()
    path = tmp_path / "broken.building.yaml"
    for _ in range(150):
        broken = bytearray(good)
        for at in rng.integers(0, len(good), 3):
            broken[at] = rng.choice(list(b'[]{},:-"#&*!|>%@\n \x00\xff09a'))
        path.write_bytes(bytes(broken))
        with suppress(MapError):
            for draft in read(path).drafts:
                write_draft(draft)
