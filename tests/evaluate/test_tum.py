"""TUM files: exact stamps, round trips, and a line number for every complaint."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.geometry import wrap_angle
from wallkit.core.types import Trajectory
from wallkit.errors import LogError, OutputError
from wallkit.evaluate.tum import (
    ns_from_seconds,
    read_tum,
    seconds_from_ns,
    trajectory_from_tum,
    tum_from_trajectory,
    write_tum,
)

STAMPS = st.integers(-(2**63) + 1, 2**63 - 1)
GOOD = "1.5 1 2 0 0 0 0 1"


@given(STAMPS)
def test_nanoseconds_survive_the_text(stamp_ns):
    assert ns_from_seconds(seconds_from_ns(stamp_ns)) == stamp_ns


@given(
    st.sets(STAMPS, min_size=1, max_size=8),
    st.lists(st.tuples(*[st.floats(-1e5, 1e5)] * 2, st.floats(-np.pi, 3.1415)), min_size=8, max_size=8),
)
def test_a_trajectory_survives_the_file_to_the_printed_digit(stamps, poses):
    written = Trajectory(np.array(sorted(stamps)), np.array(poses[: len(stamps)]))
    back = trajectory_from_tum(tum_from_trajectory(written))
    np.testing.assert_array_equal(back.stamps_ns, written.stamps_ns)
    # half of the last printed digit: 0.5e-9 m, and 2 * 0.5e-12 rad for each of sine and cosine of the half angle
    np.testing.assert_allclose(back.poses[:, :2], written.poses[:, :2], rtol=0, atol=0.5001e-9 + 1e-11)
    np.testing.assert_allclose(wrap_angle(back.poses[:, 2] - written.poses[:, 2]), 0, atol=2e-12)


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("976052890.448700", 976052890448700000),
        ("1.305031102175304032e+09", 1305031102175304032),
        ("1700000000.123456789", 1700000000123456789),
        ("-0.5", -500000000),
        ("0.0000000025", 2),
    ],
)
def test_seconds_are_read_in_decimals(text, stamp_ns):
    assert ns_from_seconds(text) == stamp_ns


@pytest.mark.parametrize("text", ["nan", "inf", "1e999999999", "soon", "99999999999"])
def test_what_is_no_time_is_refused(text):
    with pytest.raises(ValueError, match=text):
        ns_from_seconds(text)


def test_the_file_is_what_others_expect(tmp_path):
    write_tum(tmp_path / "a.tum", Trajectory(np.array([1_500_000_001]), np.array([[1.0, -2.0, np.pi / 2]])))
    assert (tmp_path / "a.tum").read_bytes() == (
        b"# timestamp tx ty tz qx qy qz qw\n1.500000001 1.000000000 -2.000000000 0 0 0 0.707106781187 0.707106781187\n"
    )


def test_a_pose_in_space_is_laid_flat():
    # turned by 90 deg about z and then rolled by 30 deg about its own x: the heading stays 90 deg
    half, roll = np.sqrt(0.5), np.deg2rad(30) / 2
    q = f"{half * np.sin(roll)} {half * np.sin(roll)} {half * np.cos(roll)} {half * np.cos(roll)}"
    flat = trajectory_from_tum(f"0 1 2 9.9 {q}\n")
    np.testing.assert_allclose(flat.poses, [[1, 2, np.pi / 2]], atol=1e-12)


def test_a_quaternion_need_not_have_length_one():
    assert trajectory_from_tum("0 0 0 0 0 0 1.2 1.2").poses[0, 2] == pytest.approx(np.pi / 2, abs=1e-12)


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("2.5 1 2 0 0 0 1", "7 columns"),
        ("2.5,1,2,0,0,0,0,1", "1 columns"),
        ("soon 1 2 0 0 0 0 1", "'soon' is not a number"),
        ("2.5 1 two 0 0 0 0 1", "not a number"),
        ("2.5 nan 2 0 0 0 0 1", "finite"),
        ("2.5 1 2 0 0 0 0 0", "not a rotation"),
        ("1.5 1 2 0 0 0 0 1", "the same as the one above"),
        ("1.499999999 1 2 0 0 0 0 1", "comes before"),
    ],
)
def test_a_bad_line_is_named(tmp_path, line, what):
    path = tmp_path / "bad.tum"
    path.write_text(f"# comment\n{GOOD}\n\n{line}\n")
    with pytest.raises(LogError, match=what) as caught:
        read_tum(path)
    assert caught.value.where == f"{path}:4"
    assert caught.value.hint


def test_files_that_cannot_be_used(tmp_path):
    with pytest.raises(LogError, match="cannot read"):
        read_tum(tmp_path / "none.tum")
    with pytest.raises(LogError, match="no pose"):
        trajectory_from_tum("# only words\n")
    with pytest.raises(OutputError, match="cannot write"):
        write_tum(tmp_path / "no" / "a.tum", trajectory_from_tum(GOOD))
