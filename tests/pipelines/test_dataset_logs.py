"""Logs whose cameras have several topics of images: no picture is written over another, and none is guessed."""

from __future__ import annotations

import numpy as np
import pytest

from tests.e2e import camera_log
from wallkit.core.types import CameraImage
from wallkit.dataset.classes import LabelSet
from wallkit.errors import LogError
from wallkit.logs.writer import McapWriter
from wallkit.pipelines.dataset.from_log import FromLogs, dataset_from_logs
from wallkit.pipelines.dataset.logs import pictures_of, sources_of

RAW, COMPRESSED, RECTIFIED = (f"/camera/front/{name}" for name in ("image_raw", "image_raw/compressed", "image_rect"))
REAR = "/camera/rear/image_raw"


@pytest.fixture
def pictures(tmp_path):
    """Names and grey levels of the pictures of a log with topics, each of its own grey, at the same times."""

    def read(topics, named=()):
        with McapWriter(tmp_path / "run.mcap") as file:
            for step in range(2):
                for level, topic in enumerate(topics):
                    data = camera_log.png(np.full((8, 8, 3), 40 * level, np.uint8))
                    stamp_ns = camera_log.START_NS + step
                    file.write(topic, CameraImage(stamp_ns, "camera", "png", data), stamp_ns)
        (source,) = sources_of((tmp_path / "run.mcap",), tuple(named), ())
        found = [(one.name, int(one.image[0, 0, 0])) for one in pictures_of(source, LabelSet(), {})]
        assert len({name for name, _ in found}) == len(found)
        return sorted((name.split("_")[1], level) for name, level in found)

    return read


def test_of_raw_and_compressed_images_one_is_taken(pictures):
    assert pictures([COMPRESSED, RAW]) == [("front", 40)] * 2
    assert pictures([COMPRESSED]) == [("front", 0)] * 2
    assert pictures([COMPRESSED, RAW, REAR]) == [("front", 40)] * 2 + [("rear", 80)] * 2


def test_of_raw_and_rectified_images_it_is_asked_which(pictures):
    with pytest.raises(LogError, match="2 topics have images of the camera 'front'") as caught:
        pictures([RAW, COMPRESSED, RECTIFIED, REAR])
    assert [line.strip() for line in caught.value.message.splitlines()[1:]] == [RAW, RECTIFIED]
    assert caught.value.hint.endswith(f"--image {RAW}")
    named = pictures([RAW, COMPRESSED, RECTIFIED, REAR], [RECTIFIED, REAR])
    assert named == [("front", 80)] * 2 + [("rear", 120)] * 2
    with pytest.raises(LogError, match="2 topics"):
        pictures([RAW, RECTIFIED], [RAW, RECTIFIED])


def test_it_is_asked_before_anything_is_written(pictures, tmp_path):
    with pytest.raises(LogError):
        pictures([RAW, RECTIFIED])
    with pytest.raises(LogError, match="2 topics"):
        dataset_from_logs(FromLogs((tmp_path / "run.mcap",)), tmp_path / "set")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
