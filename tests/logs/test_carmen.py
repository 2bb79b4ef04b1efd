"""CARMEN lines, synthesised: ranges, poses, times, and where the mount comes from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.geometry import compose, pose_from_matrix
from wallkit.errors import LogError
from wallkit.logs.carmen import looks_like_carmen
from wallkit.logs.carmen_lines import CARMEN_DECODERS, line_stamp_ns
from wallkit.logs.reader import open_log
from wallkit.logs.rig import Wanted, find_rig
from wallkit.logs.topics import pick_truth
from wallkit.logs.trajectories import trajectory_of

# the first lines of a file as CARMEN's logger writes them, shortened to fit
TAIL = "976052857.340246 localhost 0.250000"
MOUNT = np.array([0.2, -0.1, 0.3])


def text(numbers):
    return " ".join(repr(float(n)) for n in numbers)


def flaser(robot, laser, stamp="976052857.340246", count=180, value=5.0):
    return f"FLASER {count} {text([value] * count)} {text(laser)} {text(robot)} {stamp} nohost 0.25"


def odom(pose, stamp):
    return f"ODOM {text(pose)} 0.1 0.2 0.0 {stamp} nohost 0.1"


def log_with(tmp_path, *lines):
    path = tmp_path / "drawn.clf"
    path.write_text("\n".join(["# a comment", *lines]) + "\n")
    return open_log([path])


@pytest.mark.parametrize(
    ("count", "first_deg", "last_deg"),
    [(180, -90, 89), (181, -90, 90), (360, -90, 89.5), (361, -90, 90), (401, -50, 50)],
)
def test_flaser_has_the_angles_of_its_sensor(tmp_path, count, first_deg, last_deg):
    log = log_with(tmp_path, flaser([1, 2, 0.5], [1, 2, 0.5], count=count))
    scan = next(log.messages(["FLASER"])).value
    assert len(scan.ranges_m) == len(scan.angles_rad) == count
    np.testing.assert_allclose(np.rad2deg(scan.angles_rad[[0, -1]]), [first_deg, last_deg], atol=1e-4)
    assert (scan.stamp_ns, scan.beam_interval_s) == (976052857_340246000, 0.0)


def test_flaser_of_an_unknown_sensor_is_counted(tmp_path):
    log = log_with(tmp_path, flaser([0, 0, 0], [0, 0, 0]), flaser([0, 0, 0], [0, 0, 0], count=77))
    assert len(list(log.messages(["FLASER"]))) == 1
    assert "77 readings" in log.loss.lines()[0]


def test_robotlaser_states_its_angles_and_range(tmp_path):
    robot = np.array([1.0, 2.0, 0.5])
    head = "ROBOTLASER1 0 -1.5 3.0 1.5 30.0 0.01 0 3"
    line = f"{head} 1.0 2.0 30.0 2 7 8 {text(compose(robot, MOUNT))} {text(robot)} 0 0 0 0 0 {TAIL}"
    log = log_with(tmp_path, line)
    scan = next(log.messages(["ROBOTLASER1"])).value
    np.testing.assert_allclose(scan.ranges_m, [1, 2, 30])
    np.testing.assert_allclose(scan.angles_rad, [-1.5, 0, 1.5])
    assert scan.range_max_m == 30.0
    odometry = next(log.messages(["ROBOTLASER1/odometry"])).value
    np.testing.assert_allclose(odometry.pose, robot)
    np.testing.assert_allclose(pose_from_matrix(find_rig(log).mount.matrix), MOUNT, atol=1e-8)


def test_odometry_is_the_odom_lines_where_there_are_any(tmp_path):
    scan = flaser([1, 2, 0.5], [1, 2, 0.5], stamp="10.5")
    with_odom = log_with(tmp_path, odom([1, 2, 0.4], "10.0"), scan)
    assert [str(find_rig(with_odom).odometry), next(with_odom.messages(["ODOM"])).stamp_ns] == ["ODOM", 10 * 10**9]
    without = log_with(tmp_path, scan)
    assert str(find_rig(without).odometry) == "FLASER/odometry"


def test_the_mount_is_what_the_scan_lines_agree_on(tmp_path):
    robots = [np.array([1.0 * k, 0.5 * k, 0.7 * k]) for k in range(5)]
    lines = [flaser(r, compose(r, MOUNT), stamp=f"{10 + k}.0") for k, r in enumerate(robots)]
    np.testing.assert_allclose(pose_from_matrix(find_rig(log_with(tmp_path, *lines)).mount.matrix), MOUNT, atol=1e-8)

    corrected = flaser([9, 9, 0], [7, 3, 1], stamp="20.0")
    log = log_with(tmp_path, *lines, corrected)
    with pytest.raises(LogError, match="nothing tells where the LiDAR"):
        find_rig(log)
    assert find_rig(log, Wanted(lidar_pose="0.2,-0.1,0.3")).mount.source == "--lidar-pose"

    stated = log_with(tmp_path, "PARAM robot_frontlaser_offset 0.35 976052857.3 host 0", *lines, corrected)
    np.testing.assert_allclose(pose_from_matrix(find_rig(stated).mount.matrix), [0.35, 0, 0])


def test_true_poses_of_the_simulator(tmp_path):
    log = log_with(tmp_path, f"TRUEPOS 1 2 0.5 0 0 0 {TAIL}", flaser([0, 0, 0], [0, 0, 0]))
    truth = trajectory_of(log, pick_truth(log))
    np.testing.assert_allclose(truth.poses, [[1, 2, 0.5]])


def test_other_lines_are_listed_and_broken_ones_counted(tmp_path):
    log = log_with(
        tmp_path,
        "SYNC x",
        "NMEAGGA 1 2 3",
        "ODOM 1 2",
        odom(["nan", 0, 0], "5.0"),
        "FLASER 180 1 2 3",
        odom([1, 2, 3], "6.0"),
    )
    assert [m.stamp_ns for m in log.messages()] == [6 * 10**9]
    assert log.loss.undecodable == {"ODOM": 2, "FLASER": 1}
    assert log.loss.skipped == {"NMEAGGA": "1 lines of this kind are not used"}


def test_a_zero_time_is_replaced_by_the_loggers():
    assert line_stamp_ns(["ODOM", "0", "0", "0", "0.000000", "host", "1.5"]) == 1_500_000_000


@given(st.integers(1, 2**33), st.integers(0, 10**9 - 1))
def test_times_are_exact_to_the_nanosecond(seconds, nanoseconds):
    assert line_stamp_ns(f"ODOM {seconds}.{nanoseconds:09d} host 1".split()) == seconds * 10**9 + nanoseconds


@pytest.mark.parametrize("kind", CARMEN_DECODERS)
def test_every_kind_of_line_may_be_broken(kind):
    rests = ("", "1", "a b c 1 host 2", "nan 0 0 1 host 2", "0 0 0 0 0 0 0 9 1"[: 17 if "LASER1" in kind else 1])
    for name in ("FLASER", "ROBOTLASER1") if kind == "carmen/ScanOdometry" else (kind.rpartition("/")[2],):
        for rest in rests:
            with pytest.raises((ValueError, IndexError)):
                CARMEN_DECODERS[kind](f"{name} {rest}".encode())


def test_other_text_is_no_carmen():
    assert looks_like_carmen(b"# comment\n\nPARAM robot_x 1\n")
    assert not looks_like_carmen(b"hello world\n")
    assert not looks_like_carmen(b"# only comments\n")
    assert not looks_like_carmen(b"")
