"""The real captures: published and recomputed answers, and the mistakes that must be noticed."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from wallkit.calib.board.boards import Board
from wallkit.calib.extrinsics.extrinsics import solve
from wallkit.calib.extrinsics.rigid import angle_between, rotation_from_vector, rpy_from_matrix
from wallkit.calib.extrinsics.sightings import plane_sighting, problem_from_sightings
from wallkit.calib.extrinsics.solver import fit
from wallkit.cli.calib.extrinsics import extrinsics
from wallkit.core.camera import Camera
from wallkit.pipelines.calib.extrinsics import SolveOptions, run_extrinsics
from wallkit.pipelines.calib.files import gather_files

pytestmark = pytest.mark.data
ACFR = Board("chessboard", 7, 5, 0.095, plate_m=(0.85, 0.61), plate_offset_m=(0.0, 0.002))
OPTIONS = SolveOptions(0.015, "declared")


@lru_cache
def acfr(folder: Path, camera: str = "camera_info_correct_master.yaml"):
    here = folder / "calib" / "acfr_vlp16"
    gathered = gather_files([here / "corners_all40_opencv4.14.npz"], here / "pcd_target", ACFR, here / camera)
    return run_extrinsics(gathered, OPTIONS)


# of the authors of acfr_2d, ACFR-RPG/camera_2d_lidar_calibration (MIT), cam_lidar_2d_icp.py: from another, longer log
K_2D = np.array([[519.26845842, 0, 331.11197675], [0, 518.89359517, 229.43433605], [0, 0, 1]])
D_2D = np.array([0.11418155, 0.19343114, -0.00268067, 0.00371577, -1.09539701])


@pytest.fixture(scope="module")
def camera_2d(tmp_path_factory):
    from wallkit.calib.files.store import toml_from_calibration
    from wallkit.core.calibration import Calibration

    path = tmp_path_factory.mktemp("cameras") / "tb3.toml"
    path.write_text(toml_from_calibration(Calibration(Camera("plumb_bob", 640, 480, K_2D, D_2D))))
    return path


def test_vlp16_meets_the_recomputed_answer(data):
    """REF: camera in the LiDAR, rpy -1.6963 -0.0250 -1.4989, t 0.0678 0.0138 -0.1776 m, plane RMS 13.7 mm."""
    run = acfr(data)
    back = np.linalg.inv(run.result.T)
    turn = np.degrees(rpy_from_matrix(back) - (-1.6963, -0.0250, -1.4989))
    assert np.abs(turn).max() < 0.2  # clustered sigma: 0.12 0.12 0.32 deg
    np.testing.assert_allclose(back[:3, 3], (0.0678, 0.0138, -0.1776), atol=0.003)  # 4.7 8.7 1.8 mm
    assert run.plane_rms_mm == pytest.approx(13.7, abs=0.5)
    assert sum(run.result.used) == 40
    assert run.result.observability.seen == 6
    assert abs(run.scale.value - 1) < 0.01
    assert not run.scale.is_suspect


def test_vlp16_published_answer_within_its_spread(data):
    """PUB: rpy -1.6955 -0.0226 -1.4926, t 0.0628 0.0039 -0.1942, sd 0.0095 0.0088 0.0068 rad, 4.1 18.3 25.4 mm."""
    back = np.linalg.inv(acfr(data).result.T)
    assert (np.abs(rpy_from_matrix(back) - (-1.6955, -0.0226, -1.4926)) < 2 * np.array([0.0095, 0.0088, 0.0068])).all()
    assert (np.abs(back[:3, 3] - (0.0628, 0.0039, -0.1942)) < 2 * np.array([0.0041, 0.0183, 0.0254])).all()


def test_vlp16_sigma_is_clustered_not_textbook(data):
    """About 0.12 0.12 0.32 deg and 4.7 8.7 1.8 mm by bootstrap over views; (J'J)^-1 says 0.02 0.01 0.03 and 0.3 0.9 0.2."""
    sigma = np.sqrt(np.diag(acfr(data).result.covariance))
    bootstrap = np.array([*np.radians([0.12, 0.12, 0.32]), 0.0047, 0.0087, 0.0018])
    assert (sigma > 0.6 * bootstrap).all()
    assert (sigma < 1.6 * bootstrap).all()


def test_vlp16_from_fifty_guesses_is_one_answer(data):
    run = acfr(data)
    problem, T = problem_from_sightings(run.sightings), run.result.T
    rng = np.random.default_rng(0)
    for _ in range(50):
        start = T.copy()
        start[:3, :3] = rotation_from_vector(rng.normal(0, 0.5, 3)) @ T[:3, :3]
        start[:3, 3] += rng.normal(0, 0.3, 3)
        found = fit(problem, start).T
        assert np.degrees(angle_between(found, T)) < 0.01
        assert np.linalg.norm(found[:3, 3] - T[:3, 3]) < 1e-4
    for seed in range(3):
        found = solve(run.sightings, seed=seed).T
        assert np.degrees(angle_between(found, T)) < 0.01
        assert np.linalg.norm(found[:3, 3] - T[:3, 3]) < 1e-4


def test_vlp16_sides_agree_with_planes(data):
    run = acfr(data)
    both = run_extrinsics(run.gathered, replace(OPTIONS, sides="always"))
    assert sum(len(s.faces) - 1 for s in both.sightings) > 100
    sigma = np.sqrt(np.diag(run.result.covariance))
    off = both.result.T[:3, 3] - run.result.T[:3, 3]
    assert (np.abs(off) < 3 * sigma[3:]).all()
    assert (both.result.sigmas < 1.05 * run.result.sigmas).all()


def test_vlp16_wrong_intrinsics_show(data):
    """`camera_info_WRONG`: points lie 73 mm off the boards, and the LiDAR contradicts the square size."""
    run = acfr(data, "camera_info_WRONG_calib-v2.yaml")
    assert run.plane_rms_mm > 60
    assert run.scale.is_suspect
    assert "intrinsics do not belong" in run.scale.words
    assert np.median([s.board.rms_px for s in run.sightings]) > 0.8


def test_record_one_of_poses_csv_is_left_out(data):
    """Its plate is not where the pictures and the other captures put it; the others fit within centimetres."""
    run = acfr(data)
    lines = (data / "calib" / "acfr_vlp16" / "poses.csv").read_text().split()
    table = np.array([[float(v) for v in line.split(",")] for line in lines]).reshape(-1, 19, 3)
    sightings = [
        plane_sighting(s.name, s.board, record[8:12] / 1e3, sigma_m=0.005, planar_scan=False)
        for s, record in zip(run.sightings, table, strict=True)
    ]
    result = solve(sightings)
    assert [v.name for v in result.views if v.why] == ["1"]
    assert result.views[0].rms_mm > 60
    assert np.degrees(angle_between(result.T, run.result.T)) < 0.5
    assert np.linalg.norm(result.T[:3, 3] - run.result.T[:3, 3]) < 0.02


@pytest.mark.long
def test_turtlebot_refuses_six_and_answers_three(data, camera_2d, tmp_path):
    """REF: three of six directions; SE(2) yaw 1.37 deg, tx -18.7, tz -86.1 mm, spread over views 2.6 deg and 21 mm."""
    here = data / "calib" / "acfr_2d"
    words = [str(here / "images"), "--scans", str(here / "lasers"), "--camera", str(camera_2d)]
    words += ["--sigma-range", "lds-01", "--json", "-q", "-o", str(tmp_path / "no.toml")]
    done = CliRunner().invoke(extrinsics, [*words, "--board", "chessboard:11x8:0.019"])
    assert done.exit_code == 4
    assert not (tmp_path / "no.toml").exists()
    found = json.loads(done.stdout)
    assert len(found["views"]) == 5
    assert found["unseen"] == ["height", "roll", "pitch"]
    assert "tilt the board 30 deg" in found["reason"]
    assert found["T_camera_lidar"] is None
    assert found["singular_values"][2] > 3 * found["singular_values"][3]
    planar = found["planar"]
    assert planar["yaw_deg"] == pytest.approx(1.37, abs=0.4)
    assert planar["x_mm"] == pytest.approx(-18.7, abs=6)
    assert planar["z_mm"] == pytest.approx(-86.1, abs=1.0)
    assert found["plane_rms_mm"] < 5.0
    assert found["square_scale"] == pytest.approx(0.995, abs=0.003)
    declared = json.loads(CliRunner().invoke(extrinsics, [*words, "--board", "chessboard:11x8:0.020"]).stdout)
    assert declared["square_scale"] == pytest.approx(0.945, abs=0.003)
    assert declared["square_scale_is_suspect"]


def test_turtlebot_the_reference_is_least_squares_over_whole_runs(data, camera_2d):
    """REF yaw 1.37 deg, tx -18.7, tz -86.1 mm, plane RMS 4.96 mm: every return within 5 cm of the plate, ends and all, one
    weight for each. We leave out what stands off its line by 3 sigma and give each view the weight of a line: 3.7 mm."""
    from scipy.optimize import least_squares

    from wallkit.calib.extrinsics.worlds import UPRIGHT

    here = data / "calib" / "acfr_2d"
    gathered = gather_files([here / "images"], here / "lasers", Board("chessboard", 11, 8, 0.019), camera_2d)
    run = run_extrinsics(gathered, SolveOptions(0.010, "declared"))

    def placed(x):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation_from_vector([0, x[0], 0]) @ UPRIGHT, (x[1], 0, x[2])
        return T

    x = np.array([0.02, -0.015, -0.086])
    for _ in range(3):
        T, runs = placed(x), []
        for pair, sighting in zip(gathered.pairs, run.sightings, strict=True):
            middle = sighting.points_m.mean(axis=0)
            half = np.linalg.norm(sighting.points_m - middle, axis=1).max()
            near = np.linalg.norm(pair.points_m - middle, axis=1) < half + 0.06
            moved = pair.points_m[near]
            off = (moved @ T[:3, :3].T + T[:3, 3]) @ pair.pose.normal - pair.pose.distance_m
            runs.append((moved[np.abs(off) < 0.05], pair.pose))

        def distances(x, runs=runs):
            T = placed(x)
            return np.concatenate([(p @ T[:3, :3].T + T[:3, 3]) @ b.normal - b.distance_m for p, b in runs])

        x = least_squares(distances, x).x
    assert np.degrees(x[0]) == pytest.approx(1.37, abs=0.15)
    assert 1e3 * x[1] == pytest.approx(-18.7, abs=1.5)
    assert 1e3 * x[2] == pytest.approx(-86.1, abs=0.3)
    assert 1e3 * np.sqrt(np.mean(distances(x) ** 2)) == pytest.approx(4.96, abs=0.2)
    # REF: singular values 12.9 8.1 1.87 | 0.33 0.15 0.12 of all six: turns at a lever arm of the median range, in 1/cm
    rows = []
    for points, pose in runs:
        turned, n = points @ placed(x)[:3, :3].T, np.broadcast_to(pose.normal, points.shape)
        lever = np.median(np.linalg.norm(np.concatenate([p for p, _ in runs]), axis=1))
        rows.append(np.concatenate([np.cross(turned, n) / lever, n], axis=1))
    singular = np.linalg.svd(np.concatenate(rows), compute_uv=False)
    np.testing.assert_allclose(singular[:3], (12.9, 8.1, 1.87), rtol=0.05)
    assert singular[2] > 4 * singular[3]


def test_same_bytes_twice(data, tmp_path):
    here = data / "calib" / "acfr_vlp16"
    (tmp_path / "board.toml").write_text(ACFR.toml())
    words = [str(here / "corners_all40_opencv4.14.npz"), "--scans", str(here / "pcd_target"), "-q"]
    words += ["--camera", str(here / "camera_info_correct_master.yaml"), "--board", str(tmp_path / "board.toml")]
    outs = []
    for name in ("a.toml", "b.toml"):
        done = CliRunner().invoke(extrinsics, [*words, "--sigma-range", "15mm", "-o", str(tmp_path / name)])
        assert done.exit_code == 0, done.output
        outs.append((done.stdout, (tmp_path / name).read_bytes()))
    assert outs[0] == outs[1]
    assert b"pixel_error_95" in outs[0][1]
    assert "at 3 m a LiDAR point lands within" in outs[0][0]


def test_whole_rooms_are_searched_without_a_guess(data):
    """The full clouds: the plate is found among everything else, where the cut-out clouds have it."""
    from wallkit.calib.extrinsics.cloud_board import find_patch
    from wallkit.calib.extrinsics.scan_files import read_scan

    here = data / "calib" / "acfr_vlp16"
    for pose in (1, 11, 40):
        whole = read_scan(here / "pcd_full_gz" / f"pose{pose}_full.pcd.gz")
        target = read_scan(here / "pcd_target" / f"pose{pose}_target.pcd")
        found = find_patch(whole.points_m, np.array([0.85, 0.61]))
        assert found.why == ""
        assert np.linalg.norm(found.points_m.mean(axis=0) - target.points_m.mean(axis=0)) < 0.03
