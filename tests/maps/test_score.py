"""Localisability: worlds whose ambiguity is known in closed form, meshes of others, labels, invariance, and a ray oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from tests.maps.drawn import box, placed, ring, robot
from wallkit.errors import MapError
from wallkit.maps.rules import validate
from wallkit.maps.rules.base import Context
from wallkit.maps.rules.outlook import world as world_of
from wallkit.maps.rules.tolerances import Tolerances
from wallkit.maps.score.rivals import CONTINUUM
from wallkit.maps.score.score import score
from wallkit.maps.score.world import ScoreSettings, World
from wallkit.maps.sight import cast_beams, index_segments
from wallkit.maps.xml import parse
from wallkit.pipelines.map.score import probe_map

HEADER = '<wk:map format="1.0" units="m rad" level="1" scan_plane="0.3"/>'
FEW = ScoreSettings(poses=60)


def room(width: float, height: float, *more: str) -> bytes:
    return robot(HEADER, *ring("wall", 0, 0, width, height), *more)


def pillar(x: float, y: float, side: float, wk_class: str = "column") -> tuple[str, str]:
    return box("p", f"{side} {side} 2", at="0 0 1", wk_class=wk_class), placed("p", f"{x} {y} 0")


def world(data: bytes) -> World:
    return Context(parse(data, "drawn")).once(world_of)


def moved(data: bytes, x: float, y: float, yaw: float) -> bytes:
    """The map on one more link, which stands elsewhere."""
    text = data.decode().replace('<parent link="map"/>', '<parent link="moved"/>')
    extra = '<link name="moved"/>' + placed("moved", f"{x} {y} 0", f"0 0 {yaw}")
    return text.replace("</robot>", f"{extra}</robot>").encode()


# ------------------------------------------------------------------------------------------ closed forms


@pytest.mark.parametrize(
    ("data", "modes"),
    [
        pytest.param(room(6, 6), 4, id="square"),
        pytest.param(room(8, 5), 2, id="rectangle"),
        pytest.param(room(8, 5, *pillar(2.3, 1.6, 1.2)), 1, id="rectangle_with_pillar"),
        pytest.param(room(60, 2), CONTINUUM, id="corridor"),
    ],
)
def test_a_world_has_as_many_modes_as_its_symmetry(data, modes):
    found = score(world(data), FEW)
    assert found.plain.typical_modes == modes
    if modes == 1:
        assert found.plain.share < 0.1
    else:
        assert found.plain.share == 1.0


def test_the_rivals_in_a_square_are_the_pose_turned_about_its_middle():
    found = score(world(room(6, 6)), FEW)
    about = found.poses[:, :2] - 3.0
    rival = found.plain.rivals[:, :2] - 3.0
    turn = found.plain.rivals[:, 2] - found.poses[:, 2]
    quarter = np.round(turn / (math.pi / 2)) * (math.pi / 2)
    expected = np.column_stack(
        [
            np.cos(quarter) * about[:, 0] - np.sin(quarter) * about[:, 1],
            np.sin(quarter) * about[:, 0] + np.cos(quarter) * about[:, 1],
        ]
    )
    assert np.abs(rival - expected).max() < 0.05
    assert np.abs(turn - quarter).max() < math.radians(1.0)


def test_a_corridor_leaves_its_own_direction_open_until_the_range_reaches_its_ends():
    turned = world(moved(room(60, 2), 3, -2, 0.5))
    seen = score(turned, FEW).seen
    assert seen.degenerate.mean() > 0.5
    assert seen.open_direction == pytest.approx(0.5, abs=1e-3)
    far = score(turned, ScoreSettings(poses=60, max_range_m=80))
    assert far.seen.degenerate.mean() < 0.2
    # the ends take 4 atan(1 / 30) / 2 pi = 2 % of the beams seen from the middle: still too few to tell
    assert far.plain.typical_modes == CONTINUUM


def test_a_hall_larger_than_the_range_has_empty_scans_in_its_middle():
    found = score(world(room(20, 20)), ScoreSettings(poses=400, max_range_m=5))
    inner, floor = (19.9 - 10) ** 2, (19.9 - 0.5) ** 2
    assert found.seen.is_empty.mean() == pytest.approx(inner / floor, abs=0.03)


# ---------------------------------------------------------------------------------------------- labels


def test_one_wall_of_another_class_makes_every_pose_of_a_square_unique():
    wall, door = (f'<link name="wall_n"><wk:object class="{name}"/>'.encode() for name in ("wall", "door"))
    data = room(6, 6).replace(wall, door)
    assert door in data
    found = score(world(data), FEW)
    assert found.plain.share == 1.0
    assert found.labelled.share == 0.0
    assert found.landmarks == {"door": 0.0}


def test_labels_help_where_they_differ_only():
    """A column in the middle of a square turns with it; in a rectangle of walls alone there is nothing to tell."""
    found = score(world(room(6, 6, *pillar(3, 3, 1.0))), FEW)
    assert found.plain.typical_modes == found.labelled.typical_modes == 4
    assert found.landmarks == {"column": pytest.approx(found.plain.share)}


def test_labels_never_make_a_pose_ambiguous():
    found = score(world(room(8, 5, *pillar(2.3, 1.6, 0.5))), ScoreSettings(poses=200))
    assert 0 < found.labelled.share <= found.plain.share < 1
    assert not (found.labelled.is_ambiguous & ~found.plain.is_ambiguous).any()


# ------------------------------------------------------------------------------------------- invariance


def test_a_map_moved_as_a_whole_has_the_same_score():
    data = room(8, 5, *pillar(2.3, 1.6, 0.6))
    here = score(world(data), ScoreSettings(poses=150))
    there = score(world(moved(data, 12.3, -7.1, 0.7)), ScoreSettings(poses=150))
    assert len(here.poses) == len(there.poses)
    assert (here.plain.is_ambiguous != there.plain.is_ambiguous).mean() < 0.03
    assert np.array_equal(here.seen.degenerate, there.seen.degenerate)


def test_the_score_is_the_same_every_time_and_the_seed_moves_the_poses():
    found = world(room(8, 5, *pillar(2.3, 1.6, 0.6)))
    first, again, other = score(found, FEW), score(found, FEW), score(found, FEW, seed=1)
    assert np.array_equal(first.plain.rivals, again.plain.rivals, equal_nan=True)
    assert np.array_equal(first.poses, again.poses)
    assert not np.array_equal(first.poses[:5], other.poses[:5])


# ---------------------------------------------------------------------------------------- real meshes


@pytest.mark.data
@pytest.mark.parametrize(("name", "modes"), [("cube", 4), ("tray", 2)])
def test_sliced_meshes_have_their_published_number_of_modes(data, name, modes):
    import trimesh

    mesh = trimesh.load(data / f"maps/ambiguity_worlds/{name}.dae", force="mesh")
    low, high = mesh.bounds[:, 2]
    lines = trimesh.intersections.mesh_plane(mesh, [0, 0, 1], [0, 0, (low + high) / 2 + 1e-4])
    pieces = shapely.get_parts(shapely.polygonize([shapely.LineString(line) for line in np.round(lines[:, :, :2], 4)]))
    floor = min(pieces, key=lambda piece: abs(piece.centroid.x) + abs(piece.centroid.y) + 1e-3 * piece.area)
    ends = shapely.get_coordinates(floor.exterior)
    segments = np.hstack([ends[:-1], ends[1:]])
    count = len(segments)
    none, ones = np.zeros(count, dtype=bool), np.ones(count)
    drawn = World(segments, np.zeros(count, dtype=np.int64), ("wall",), ones, none, none, floor)
    reach = float(np.hypot(*np.ptp(ends, axis=0)))
    found = score(drawn, ScoreSettings(poses=60, max_range_m=reach + 1))
    assert found.plain.typical_modes == modes
    assert found.plain.share == 1.0


# ---------------------------------------------------------------------------------------------- rules


def test_the_rules_print_what_they_assume_and_take_what_the_map_says():
    (said,) = [f.message for f in validate(room(6, 6), select=["L003"]).findings]
    assert "range 12 m (default), robot radius 0.25 m (default)" in said
    assert said.startswith("100% of")
    assert "4 modes" in said
    told = Tolerances(max_range_m=8.0, robot_radius_m=0.4)
    (said,) = [f.message for f in validate(room(6, 6), told, select=["L003"]).findings]
    assert "range 8 m, robot radius 0.4 m" in said


def test_ambiguity_is_an_error_above_half_and_a_warning_above_a_tenth():
    half = room(8, 5, *pillar(2.3, 1.6, 0.75))
    shares = {}
    for name, data in (("square", room(6, 6)), ("some", half), ("clear", room(8, 5, *pillar(2.3, 1.6, 1.2)))):
        found = validate(data, select=["L003"]).findings
        shares[name] = [f.severity for f in found]
    assert shares == {"square": ["error"], "some": ["warning"], "clear": []}


@pytest.mark.data
def test_the_example_and_the_sound_files_have_nothing_to_be_told(data):
    codes = ["L003", "L004", "L006", "L008", "L009", "L014"]
    for file in ("wkmap_example/restroom.wkmap.urdf", "malformed/parse/plain.urdf", "malformed/parse/mimic.urdf"):
        report = validate(data / "maps" / file, select=codes)
        assert report.findings == ()
        assert set(report.checked) == {f"WK-{code}" for code in codes}


# ---------------------------------------------------------------------------------------------- probe


@pytest.mark.data
def test_a_probe_measures_what_shapely_finds_on_each_ray(data):
    path = data / "maps/wkmap_example/restroom.wkmap.urdf"
    for pose in ((2.5, 4.0, -1.57), (0.4, 0.3, 0.3), (4.5, 1.7, 2.0)):
        probe = probe_map(path, Tolerances(), pose)
        solid = shapely.multilinestrings(probe.world.segments.reshape(-1, 2, 2).tolist())
        start = np.array(pose[:2])
        for bearing, reach in zip(probe.bearings_rad, probe.ranges_m, strict=True):
            angle = pose[2] + bearing
            end = start + 12.0 * np.array([math.cos(angle), math.sin(angle)])
            met = shapely.LineString([start, end]).intersection(solid)
            assert reach == pytest.approx(shapely.distance(met, shapely.Point(start)), abs=1e-6)
        assert sum(probe.shares().values()) == pytest.approx(1.0)


@pytest.mark.data
def test_a_probe_where_nobody_can_be_is_refused_with_the_nearest_place(data):
    path = data / "maps/wkmap_example/restroom.wkmap.urdf"
    for pose, said in (
        ((2.5, 2.06, 0.0), "inside 'wall_mid'"),
        ((9.0, 9.0, 0.0), "outside"),
        ((4.6, 4.9, 0), "inside 'toilet_1'"),
    ):
        with pytest.raises(MapError, match=said) as raised:
            probe_map(path, Tolerances(), pose)
        assert "nearest place" in raised.value.hint


def test_beams_pass_through_glass_to_what_stands_behind():
    glass = box("pane", "0.02 4.9 2", at="0 0 1", wk_class="glass"), placed("pane", "5 2.5 0")
    found = world(room(8, 5, *glass))
    returns = found.p_return >= ScoreSettings.p_return_min
    sight = index_segments(found.segments, seen=returns)
    seen = cast_beams(sight, np.array([[2.0, 2.5, 0.0]]), np.zeros(1), range_max_m=12.0)
    assert seen.ranges_m[0, 0] == pytest.approx(7.95 - 2.0)
