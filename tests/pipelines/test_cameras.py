"""Which topic of a log has the images of a calibration's camera, and what is said where several could be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.e2e import camera_log
from wallkit.core.types import CameraImage
from wallkit.errors import CalibrationError, LogError
from wallkit.logs.encode import encode
from wallkit.logs.reader import open_log
from wallkit.logs.writer import McapWriter
from wallkit.pipelines.cameras import CameraRequest, find_cameras

RAW, COMPRESSED, RECTIFIED = (f"/camera/front/{name}" for name in ("image_raw", "image_raw/compressed", "image_rect"))
BLACK = camera_log.png(np.zeros((camera_log.HEIGHT, camera_log.WIDTH, 3), np.uint8))
IMAGE = CameraImage(camera_log.START_NS, "camera_front", "png", BLACK)


@pytest.fixture
def found(tmp_path):
    """The topic that is taken from a log with these, which may have others that were announced and stayed silent."""

    def find(topics, camera="", *, silent=(), **changes):
        with McapWriter(tmp_path / "log.mcap") as file:
            for topic in silent:
                # what a recorder leaves of a topic that nobody wrote to
                file._channel(topic, encode(IMAGE)[0], None, "")
            for topic in topics:
                file.write(topic, IMAGE, IMAGE.stamp_ns)
        made = camera_log.calibration()
        path = camera_log.write_calibration(
            tmp_path / "front.toml", replace(made, camera=replace(made.camera, **changes))
        )
        request = CameraRequest((path,), (camera,) if camera else ())
        log = open_log([tmp_path / "log.mcap"])
        (one,) = find_cameras(log, request, is_oracle=False, lidar_frame="laser")
        return one.topic

    return find


@pytest.mark.parametrize("camera", ["", "front"])
@pytest.mark.parametrize("by", [{}, {"frame": ""}, {"name": ""}])
def test_raw_and_compressed_are_the_same_images_and_raw_ones_lose_nothing(found, camera, by):
    assert found([COMPRESSED, RAW], camera, **by) == RAW
    assert found([COMPRESSED], camera, **by) == COMPRESSED
    assert found([COMPRESSED], camera, silent=[RAW], **by) == COMPRESSED
    assert found([RAW], camera, silent=[COMPRESSED], **by) == RAW


def test_a_whole_topic_is_taken_at_its_word(found):
    for topic in (RAW, COMPRESSED, RECTIFIED):
        assert found([RAW, COMPRESSED, RECTIFIED], topic) == topic
        assert found([RAW, COMPRESSED, RECTIFIED], topic.lstrip("/")) == topic


def test_a_calibration_that_names_nothing_is_of_the_only_camera_also_if_that_is_recorded_twice(found):
    assert found([RAW, COMPRESSED], frame="", name="") == RAW
    with pytest.raises(CalibrationError, match=r"\('', frame ''\) is not in the log"):
        found([RAW, "/camera/rear/image_raw"], frame="", name="")


@pytest.mark.parametrize(
    ("camera", "by", "whose"),
    [
        ("", {}, r"of the camera of this calibration \('front', frame 'camera_front'\)"),
        ("", {"frame": "elsewhere"}, r"of the camera of this calibration \('front', frame 'elsewhere'\)"),
        ("front", {}, "of a camera 'front'"),
    ],
)
def test_of_raw_and_rectified_images_nobody_can_tell_which_was_calibrated(found, camera, by, whose):
    with pytest.raises(LogError, match=f"2 topics have images {whose}") as caught:
        found([RAW, COMPRESSED, RECTIFIED], camera, **by)
    assert [line.split()[0] for line in caught.value.message.splitlines()[1:]] == [RAW, RECTIFIED]
    assert caught.value.hint.endswith(f"--camera {RAW}")


def test_a_camera_that_is_not_there_is_told_with_those_that_are(found):
    with pytest.raises(CalibrationError) as caught:
        found([RAW, COMPRESSED], frame="camera_rear", name="rear")
    assert caught.value.message.endswith(f"is not in the log: front ({RAW}, frame camera_front)")
    with pytest.raises(LogError, match="no camera 'rear'"):
        found([RAW], "rear")
