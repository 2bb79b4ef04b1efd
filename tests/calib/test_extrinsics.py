"""The answer with its limits: rank-deficient captures named, outliers left out and said, CAD held, real sets met."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wallkit.calib.extrinsics.advice import next_pose
from wallkit.calib.extrinsics.audits import range_bias, square_size
from wallkit.calib.extrinsics.extrinsics import Hold, evaluate, plane_rms_mm, sigma_words, solve, subset
from wallkit.calib.extrinsics.pixel_error import pixel_error_95
from wallkit.calib.extrinsics.planar import planar_answer
from wallkit.calib.extrinsics.rigid import angle_between, rotation_from_vector
from wallkit.calib.extrinsics.sightings import problem_from_sightings
from wallkit.calib.extrinsics.solver import fit
from wallkit.calib.extrinsics.worlds import UPRIGHT, World, board_at, draw_sightings, mounting, sighting_of
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError


def level(offset=(0.02, 0.08, -0.06)):
    """A LiDAR mounted exactly level: boards that stand upright then show it nothing of height, roll and pitch."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = UPRIGHT, offset
    return T


def boards(world, T, poses, seed=0):
    rng = np.random.default_rng(seed)
    found = [sighting_of(world, T, board_at(x, y, z, pitch_deg=p, yaw_deg=w), rng=rng) for x, y, z, p, w in poses]
    return [replace(s, name=f"view {i + 1}") for i, s in enumerate(found) if s is not None]


def upright(count, rng):
    return [(rng.uniform(-0.3, 0.3), 0.05, rng.uniform(0.9, 2.5), 0.0, rng.uniform(-45, 45)) for _ in range(count)]


def test_full_answer_of_tilted_boards():
    rng = np.random.default_rng(0)
    T = mounting(rng)
    sightings = draw_sightings(rng, World(), T, 20)
    result = solve(sightings)
    assert result.kind == "full"
    assert result.observability.unseen == ()
    off = np.abs(result.T - T)
    assert off[:3, 3].max() < 0.02
    assert np.degrees(angle_between(result.T, T)) < 0.7
    assert [source for _, _, source in sigma_words(result)] == ["data"] * 6


def test_upright_boards_and_a_planar_lidar_leave_height_roll_and_pitch_open():
    T = level()
    result = solve(boards(World(), T, upright(12, np.random.default_rng(1))))
    assert result.kind == "planar"
    assert result.covariance is None
    assert result.observability.unseen == ("height", "roll", "pitch")
    assert "not constrained by vertical boards: tilt the board 30 deg" in result.observability.reason
    assert result.observability.seen == 3
    yaw, x, z = planar_answer(result.placement)
    assert yaw == pytest.approx(0.0, abs=np.radians(0.3))
    assert (x, z) == pytest.approx((0.02, -0.06), abs=0.004)


def test_one_orientation_leaves_three_directions_or_more_open():
    rng = np.random.default_rng(2)
    poses = [(rng.uniform(-0.4, 0.4), rng.uniform(0.0, 0.2), rng.uniform(1, 2.5), -20.0, 25.0) for _ in range(12)]
    for planar in (True, False):
        result = solve(boards(World(is_planar=planar), level(), poses), prior_deg=0.3, prior_mm=20)
        assert result.kind in ("refused", "planar")
        assert result.observability.seen <= 3
        assert result.observability.reason


def test_two_orientations_leave_the_shift_along_their_intersection_open():
    """The normals span a plane: the shift along n1 x n2 is not seen, whatever the LiDAR."""
    rng = np.random.default_rng(3)
    poses = [(rng.uniform(-0.3, 0.3), 0.05, rng.uniform(1, 2.5), 0.0, 35.0 * (-1) ** i) for i in range(14)]
    result = solve(boards(World(is_planar=False), level(), poses))
    assert result.observability.seen == 5
    assert result.observability.unseen == ("height",)
    assert result.kind == "refused"
    assert "height" in result.observability.reason
    assert "normals do not lie in one plane" in solve_reason_of_shift(result)


def solve_reason_of_shift(result):
    """A single open shift is explained by the normals unless it is the height of a level LiDAR."""
    from wallkit.calib.extrinsics.observability import _reason

    return _reason(result.observability.directions, ("shift along (+0.00 +0.00 +1.00) of the LiDAR",))


def test_a_translated_board_leaves_its_own_plane_open():
    rng = np.random.default_rng(4)
    poses = [(rng.uniform(-0.3, 0.3), rng.uniform(0, 0.1), rng.uniform(1, 2), 0.0, 0.0) for _ in range(10)]
    result = solve(boards(World(is_planar=False), level(), poses))
    assert result.observability.seen == 3
    assert set(result.observability.unseen) == {"left", "height", "roll"}


def test_cad_holds_what_the_boards_do_not_show_and_nothing_else():
    T = level()
    cad = T.copy()
    cad[:3, 3] += (0.05, 0.01, 0.05)  # camera axes: right and forward are seen, down (height) is not
    result = solve(boards(World(), T, upright(14, np.random.default_rng(5))), hold=Hold(cad, 1.0, 10.0))
    assert result.kind == "held"
    assert result.covariance is not None
    sources = [source for _, _, source in sigma_words(result)]
    assert sources == ["CAD", "CAD", "data", "data", "data", "CAD"]
    np.testing.assert_allclose(result.T[[0, 2], 3], T[[0, 2], 3], atol=0.006)
    assert result.T[1, 3] == pytest.approx(cad[1, 3], abs=0.004)
    assert result.sigmas[5] == pytest.approx(0.010, rel=0.1)
    assert np.degrees(result.sigmas[0]) == pytest.approx(1.0, rel=0.1)


def test_a_board_that_moved_is_left_out_and_said():
    rng = np.random.default_rng(6)
    T = mounting(rng)
    sightings = list(draw_sightings(rng, World(is_planar=False), T, 12))
    board = sightings[4].board
    pushed = board.T_camera_board.copy()
    pushed[:3, 3] += 0.08 * board.normal
    sightings[4] = replace(sightings[4], board=replace(board, T_camera_board=pushed))
    result = solve(sightings)
    assert [v.name for v in result.views if v.why] == ["view 5"]
    assert "80 mm off the board" in result.views[4].why or "mm off the board" in result.views[4].why
    assert any("view 5" in warning for warning in result.warnings)
    clean = solve([s for i, s in enumerate(sightings) if i != 4])
    np.testing.assert_allclose(result.T, clean.T, atol=1e-6)


def test_held_out_views_are_judged_without_taking_part():
    rng = np.random.default_rng(7)
    T = mounting(rng)
    sightings = draw_sightings(rng, World(is_planar=False), T, 20)
    result = solve(subset(sightings, range(0, 20, 2)))
    held_out = evaluate(result.T, subset(sightings, range(1, 20, 2)))
    assert len(held_out) == 10
    assert 8 < plane_rms_mm(held_out) < 13  # sigma of a range is 10 mm


def test_a_wrong_guess_is_noticed():
    rng = np.random.default_rng(8)
    T = mounting(rng)
    wrong = np.linalg.inv(T)  # the classic: the other direction
    result = solve(draw_sightings(rng, World(is_planar=False), T, 12), guess=wrong)
    assert np.degrees(angle_between(result.T, T)) < 0.3
    assert any("lidar -> camera" in warning for warning in result.warnings)


def test_square_size_is_audited():
    rng = np.random.default_rng(9)
    T = mounting(rng)
    sightings = draw_sightings(rng, World(is_planar=False), T, 20)
    honest = square_size(solve(sightings), sightings, square_m=0.075)
    assert honest.value == pytest.approx(1.0, abs=0.005)
    assert not honest.is_suspect
    # the same pictures with squares declared 5 % too large
    wrong = [replace(s, board=s.board.scaled(1.05)) for s in sightings]
    audit = square_size(solve(wrong), wrong, square_m=0.075 * 1.05)
    assert audit.value == pytest.approx(1 / 1.05, abs=0.006)
    assert audit.is_suspect
    assert "measure 75" in audit.words


def test_range_bias_is_told_from_many_distances_only():
    rng = np.random.default_rng(10)
    T = mounting(rng)
    sightings = draw_sightings(rng, World(is_planar=False), T, 24)
    long = []
    for s in sightings:
        points = s.points_m * (1 + 0.03 / np.linalg.norm(s.points_m, axis=1, keepdims=True))
        long.append(replace(s, faces=(replace(s.faces[0], points_m=points),)))
    audit = range_bias(solve(long), long)
    assert audit.value == pytest.approx(-0.03, abs=0.006)
    assert "long" in audit.words
    assert range_bias(solve(sightings[:8]), sightings[:8]) is None


def test_advice_tilts_the_board_when_height_is_open():
    world, T = World(), level()
    sightings = boards(world, T, upright(12, np.random.default_rng(11)))
    result = solve(sightings)
    advice = next_pose(problem_from_sightings(sightings), result.T, result.observability, world)
    assert "tilted 30 deg" in advice.words or "rolled 30 deg" in advice.words
    assert advice.after < advice.before


def test_pixel_error_covers_drawn_errors():
    """Monte Carlo of transforms: 95 % of the points at a range land within the table's value, at the worst place."""
    rng = np.random.default_rng(12)
    camera = Camera("plumb_bob", 640, 480, np.array([[500, 0, 320], [0, 500, 240], [0, 0, 1.0]]), np.zeros(5))
    T = level()
    root = np.diag([0.003, 0.002, 0.004, 0.005, 0.003, 0.006])
    table = pixel_error_95(camera, T, root @ root.T, ranges_m=(1.0, 3.0), elevations=np.zeros(2))
    for range_m, limit in table:
        p = np.array([range_m * np.cos(0.45), range_m * np.sin(0.45), 0.0])
        here = camera.project(p @ T[:3, :3].T + T[:3, 3])
        drawn = root @ rng.normal(size=(6, 4000))
        moved = np.array([rotation_from_vector(d[:3]) @ (T[:3, :3] @ p) + T[:3, 3] + d[3:] for d in drawn.T])
        error = np.linalg.norm(camera.project(moved) - here, axis=1)
        share = (error < limit).mean()
        assert 0.94 < share < 0.995
    assert table[0, 1] > table[1, 1]


def test_pixel_error_is_that_of_the_rows_that_beams_can_meet():
    """A LiDAR of +-15 deg never meets the rows where a roll and a height that are badly known would do most harm."""
    camera = Camera("plumb_bob", 640, 480, np.array([[300, 0, 320], [0, 300, 240], [0, 0, 1.0]]), np.zeros(5))
    T, C = level(), np.diag([1e-3, 1e-3, 1e-2, 1e-3, 1e-3, 1e-3]) ** 2
    low, high = np.radians([-15.0, 15.0])
    planar, band, anything = (
        pixel_error_95(camera, T, C, elevations=beams, ranges_m=(3.0,))[0, 1]
        for beams in (np.zeros(2), np.array([low, high]), None)
    )
    assert planar < band < 0.98 * anything
    # nothing of the image is hit by beams that all point up
    assert not len(pixel_error_95(camera, T, C, elevations=np.radians([70.0, 80.0])))


def test_too_few_views():
    rng = np.random.default_rng(13)
    with pytest.raises(CalibrationError, match=r"in 2 poses; 3 is the least"):
        solve(draw_sightings(rng, World(), mounting(rng), 2))


def test_fit_keeps_its_inputs():
    rng = np.random.default_rng(14)
    T = mounting(rng)
    before = T.copy()
    fit(problem_from_sightings(draw_sightings(rng, World(), T, 8)), T)
    np.testing.assert_array_equal(T, before)
