"""The camera_info beside a log's images is compared with the camera that the images give, or said to be none."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.calib.board.boards import Board
from wallkit.core.camera import Camera
from wallkit.core.types import CameraImage, CameraInfo
from wallkit.logs.writer import McapWriter
from wallkit.pipelines.calib.captures import CaptureRequest
from wallkit.pipelines.calib.intrinsics_info import published_against

K = np.array([[520.0, 0, 320], [0, 520, 240], [0, 0, 1]])
CAMERA = Camera("plumb_bob", 640, 480, K, np.zeros(5))


def published(tmp_path, model="plumb_bob", k=K, size=(640, 480)):
    path = tmp_path / "log.mcap"
    with McapWriter(path) as writer:
        P = np.hstack([k, np.zeros((3, 1))])
        writer.write("/cam/camera_info", CameraInfo(0, "c", *size, model, np.zeros(5), k, np.eye(3), P), 0)
        writer.write("/cam/image/compressed", CameraImage(0, "c", "png", b""), 0)
    return published_against(CaptureRequest((path,), Board("chessboard", 8, 6, 0.07)), CAMERA)


def test_the_same_camera_is_nowhere_else(tmp_path):
    found = published(tmp_path)
    assert found.topic == "/cam/camera_info"
    assert found.difference.worst < 1e-6


def test_a_focal_length_off_by_a_percent_shows(tmp_path):
    """At 200 px from the middle, one per cent is 2 px."""
    wide = K.copy()
    wide[[0, 1], [0, 1]] *= 1.01
    found = published(tmp_path, k=wide)
    assert 0.5 < found.difference.median < 3
    assert found.difference.worst > 2
    assert "/cam/camera_info puts pixels elsewhere by" in found.words


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"model": ""}, "distortion"),
        ({"k": K * np.nan}, "not finite"),
        ({"size": (320, 240)}, "it is for 320 x 240 px, the images have 640 x 480"),
    ],
)
def test_one_that_cannot_be_is_said_and_hinders_nothing(tmp_path, changes, said):
    found = published(tmp_path, **changes)
    assert found.difference is None
    assert said in found.words
