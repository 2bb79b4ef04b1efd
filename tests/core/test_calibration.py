"""The noun that carries a calibration."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.calibration import Calibration
from wallkit.core.camera import Camera
from wallkit.errors import CalibrationError

CAMERA = Camera("plumb_bob", 640, 480, np.diag([600.0, 600.0, 1.0]), np.zeros(5), frame="optical")
A, B = 1.5, 6.0
TABLE = np.array([(r, np.hypot(A, B / r)) for r in (0.5, 1.0, 2.0, 4.0, 8.0)])


def test_pixel_error_is_that_of_the_table_and_never_below_the_truth_elsewhere():
    found = Calibration(CAMERA, pixel_error_95=TABLE)
    np.testing.assert_allclose(found.pixel_error_95_at(TABLE[:, 0]), TABLE[:, 1])
    ranges = np.geomspace(0.05, 60, 400)
    truth = np.hypot(A, B / ranges)
    errors = found.pixel_error_95_at(ranges)
    assert (errors >= truth - 1e-9).all()
    assert (errors <= truth * 1.25).all()
    assert (np.diff(errors) <= 1e-12).all()


def test_an_unknown_pixel_error_is_nan():
    assert np.isnan(Calibration(CAMERA).pixel_error_95_at(3.0))
    assert np.isnan(Calibration(CAMERA, pixel_error_95=TABLE).pixel_error_95_at(0.0))


def test_frames():
    assert Calibration(CAMERA, T_camera_lidar=np.eye(4), lidar_frame="laser").camera_frame == "optical"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"T_camera_lidar": np.diag([1.0, 1, -1, 1])}, "no rigid transform"),
        ({"T_camera_lidar": 2 * np.eye(4)}, "no rigid transform"),
        ({"T_camera_lidar": np.eye(3)}, "4 x 4"),
        ({"covariance": np.eye(5)}, "6 x 6"),
        ({"covariance": -np.eye(6)}, "positive diagonal"),
        ({"camera_covariance": np.eye(8)}, "9 x 9"),
        ({"verdict": "MAYBE"}, "one of: PASS, FAIL, CANNOT TELL"),
        ({"pixel_error_95": [[2, 1.0], [1, 2.0]]}, "ascending"),
        ({"pixel_error_95": [[1, np.nan]]}, "table"),
        ({"elevations": [0.2, -0.2]}, "elevations"),
        ({"elevations": [0.0, np.nan]}, "elevations"),
        ({"degrees": 0.0}, "degrees of freedom"),
    ],
)
def test_what_cannot_be_is_refused(changes, words):
    with pytest.raises(CalibrationError, match=words):
        Calibration(CAMERA, **changes)
