"""Images are segmented ahead, once each, in order, and skipped by stamps alone."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from wallkit.core.types import CameraImage, Frame, Points, View
from wallkit.segment.ahead import look_ahead
from wallkit.segment.class_map import class_map

EMPTY = np.zeros(0, dtype=np.float32)


def frame(stamp_ms: int, image_ms: int | None) -> Frame:
    points = Points(
        stamp_ms * 10**6, np.zeros((0, 3), np.float32), EMPTY, np.zeros(0, np.int64), np.zeros(2), 10.0, EMPTY
    )
    views = () if image_ms is None else (view("/camera", image_ms),)
    return Frame(stamp_ms * 10**6, points, np.zeros(3), views=views)


def view(topic: str, image_ms: int) -> View:
    return View(topic, CameraImage(image_ms * 10**6, "camera", "jpeg", b""), image_ms * 10**6, np.zeros(3))


def answer(image: CameraImage):
    """A picture of one pixel that says its own time."""
    return class_map(np.array([[image.stamp_ns // 10**6 % 1000]]), tuple(str(n) for n in range(1000)))


def shown(pairs) -> list[int | None]:
    return [int(seen[0].segmentation.labels()[0, 0]) if seen else None for _, seen in pairs]


def test_every_frame_comes_in_order_with_its_own_image():
    frames = [frame(k * 100, k * 100 + 3) for k in range(8)]
    pairs = list(look_ahead(frames, answer))
    assert [f for f, _ in pairs] == frames
    assert shown(pairs) == [k * 100 + 3 for k in range(8)]
    assert all(seen.stamp_ns == f.views[0].image.stamp_ns for f, (seen,) in pairs)


def test_the_next_images_are_looked_at_while_a_frame_is_worked_on():
    begun = {k: threading.Event() for k in range(6)}

    def look(image):
        begun[image.stamp_ns // 10**8].set()
        return answer(image)

    for k, (_, seen) in enumerate(look_ahead([frame(k * 100, k * 100) for k in range(6)], look, frames_ahead=2)):
        assert len(seen) == 1
        assert all(begun[j].wait(timeout=30) for j in range(k, min(k + 3, 6)))
        assert not any(begun[j].is_set() for j in range(k + 3, 6))


def test_an_image_that_scans_share_is_looked_at_once():
    calls = []

    def look(image):
        calls.append(image.stamp_ns)
        return answer(image)

    frames = [frame(k * 25, k // 4 * 100) for k in range(12)]
    assert shown(look_ahead(frames, look)) == [0] * 4 + [100] * 4 + [200] * 4
    assert len(calls) == 3


@pytest.mark.parametrize(("rate_hz", "expected"), [(5, 2), (10 / 3, 3), (2.5, 4), (1, 10), (10, 1), (100, 1)])
def test_images_are_skipped_by_rate_also_when_their_stamps_jitter(rate_hz, expected):
    rng = np.random.default_rng(3)
    stamps = (np.arange(40) * 100 + rng.integers(-8, 9, size=40) + 500).tolist()
    found = shown(look_ahead([frame(t, t) for t in stamps], answer, rate_hz=rate_hz))
    assert [k for k, what in enumerate(found) if what is not None] == list(range(0, 40, expected))


def test_images_are_skipped_when_they_are_not_needed_and_that_costs_no_slot():
    frames = [frame(k * 100, k * 100) for k in range(6)]
    needed = look_ahead(frames, answer, rate_hz=5, is_needed=lambda f: f.stamp_ns >= 10**8)
    assert shown(needed) == [None, 100, None, 300, None, 500]


def test_an_image_that_the_next_scan_needs_is_looked_at_after_all():
    frames = [frame(0, 0), frame(25, 0), frame(50, 0)]
    assert shown(look_ahead(frames, answer, is_needed=lambda f: f.stamp_ns > 0)) == [None, 0, 0]


def test_frames_without_an_image_or_with_an_unreadable_one_have_none():
    frames = [frame(0, None), frame(100, 100), frame(110, 100), frame(200, 200)]

    def look(image):
        return None if image.stamp_ns == 10**8 else answer(image)

    assert shown(look_ahead(frames, look)) == [None, None, None, 200]


def test_an_error_of_the_thread_reaches_the_caller():
    def look(_):
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        list(look_ahead([frame(0, 0)], look))


def test_leaving_early_ends_the_thread():
    before = threading.active_count()
    walk = look_ahead((frame(k * 100, k * 100) for k in range(1000)), answer)
    next(walk)
    walk.close()
    assert threading.active_count() == before


def test_each_camera_has_its_own_images_and_rate():
    frames = []
    for k in range(6):
        both = view("/left", k * 100), view("/right", k // 2 * 200)
        frames.append(replace(frame(k * 100, None), views=both))
    found = list(look_ahead(frames, answer, rate_hz=5))
    assert [[(s.topic, s.stamp_ns // 10**6) for s in seen] for _, seen in found] == [
        [*([("/left", k * 100)] if k % 2 == 0 else []), ("/right", k // 2 * 200)] for k in range(6)
    ]
