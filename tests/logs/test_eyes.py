"""A sweep takes the image nearest to its middle, however fast the camera is and however late the sweep is recorded."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.types import CameraImage
from wallkit.logs.eyes import Eyes
from wallkit.logs.rig import CameraTopic

MS = 1_000_000
TOPIC = "/camera"


def eyes(tolerance_s=0.06, **offsets_ns):
    return Eyes(
        [CameraTopic(TOPIC), *(CameraTopic(topic, offset) for topic, offset in offsets_ns.items())], tolerance_s
    )


def picture(stamp_ns):
    return CameraImage(stamp_ns, "cam", "jpeg", b"")


def chosen(of, moment_ns):
    found = {}
    for image in of.held:
        of.offer(found, moment_ns, image)
    return {topic: taken.image.stamp_ns for topic, taken in found.items()}


@pytest.mark.parametrize("late_ms", [0, 100, 200, 500, 900])
@pytest.mark.parametrize("rate_hz", [5, 30, 60, 90])
def test_the_nearest_image_is_there_whatever_the_rate_and_the_delay(rate_hz, late_ms):
    """Sweeps of 0.1 s, recorded so long after their end; images when they are taken."""
    of, period_ns = eyes(tolerance_s=0.5 / rate_hz + 1e-3), round(10**9 / rate_hz)
    stamps = range(0, 7 * 10**9, period_ns)
    coming = iter(stamps)
    stamp = next(coming)
    for begin_ns in range(0, 3_900 * MS, 100 * MS):
        while stamp <= begin_ns + (100 + late_ms) * MS:
            of.take(TOPIC, picture(stamp))
            stamp = next(coming)
        middle_ns = begin_ns + 50 * MS
        off_ns = abs(chosen(of, middle_ns)[TOPIC] - middle_ns)
        assert off_ns == min(abs(s - middle_ns) for s in stamps)
        of.forget_before(begin_ns)


@given(st.lists(st.integers(0, 3_000), min_size=1, max_size=400))
def test_no_stamps_make_it_hold_more_than_its_share(stamps_ms):
    """Images of three seconds in any order: never more than 120, and always the last."""
    of = eyes()
    for stamp_ms in stamps_ms:
        of.take(TOPIC, picture(stamp_ms * MS))
        assert len(list(of.held)) <= 120
    assert list(of.held)[-1].moment_ns == stamps_ms[-1] * MS


def test_a_second_of_images_is_held_and_no_more():
    """From the last image but one, and the tolerance beside it."""
    of = eyes()
    for k in range(1000):
        of.take(TOPIC, picture(k * 50 * MS))
    assert [taken.moment_ns for taken in of.held] == [k * 50 * MS for k in range(977, 1000)]


def test_images_that_a_sweep_has_left_behind_are_forgotten():
    of = eyes(tolerance_s=0.06)
    for k in range(10):
        of.take(TOPIC, picture(k * 20 * MS))
    of.forget_before(150 * MS)
    assert [taken.moment_ns for taken in of.held] == [100 * MS, 120 * MS, 140 * MS, 160 * MS, 180 * MS]
    of.forget_before(900 * MS)
    assert not list(of.held)
    # what it has seen it still knows
    assert of.have_seen(180 * MS)
    assert not of.have_seen(181 * MS)


@pytest.mark.parametrize("jump_ms", [-60_000, -2_000, 2_000, 60_000])
def test_after_a_jump_of_the_clock_only_images_by_the_new_one_are_held(jump_ms):
    of = eyes()
    for k in range(30):
        of.take(TOPIC, picture((100_000 + k * 20) * MS))
    for k in range(10):
        of.take(TOPIC, picture((100_600 + jump_ms + k * 20) * MS))
    assert [taken.moment_ns // MS for taken in of.held] == [100_600 + jump_ms + k * 20 for k in range(10)]
    assert of.have_seen((100_780 + jump_ms) * MS)
    assert not of.have_seen((100_781 + jump_ms) * MS)


@pytest.mark.parametrize("wrong_ms", [0, 90_000, 110_000])
def test_one_wrong_stamp_costs_no_other_image(wrong_ms):
    of = eyes()
    for k in range(20):
        of.take(TOPIC, picture((100_000 + k * 20) * MS))
    of.take(TOPIC, picture(wrong_ms * MS))
    for k in range(20, 30):
        of.take(TOPIC, picture((100_000 + k * 20) * MS))
    for k in range(30):
        moment_ns = (100_000 + k * 20) * MS
        assert chosen(of, moment_ns) == {TOPIC: moment_ns}


def test_every_camera_has_its_own_clock_and_must_have_seen_the_moment():
    of = eyes(right=300 * MS)
    of.take(TOPIC, picture(1_000 * MS))
    assert not of.have_seen(900 * MS)
    of.take("right", picture(1_250 * MS))
    assert not of.have_seen(1_000 * MS)
    assert of.have_seen(950 * MS)
    assert chosen(of, 975 * MS) == {TOPIC: 1_000 * MS, "right": 1_250 * MS}


def test_a_slow_camera_with_a_wide_tolerance_is_waited_for_as_long():
    """An image 2.9 s before a sweep that is recorded 0.9 s late: 3.8 s after it."""
    of = eyes(tolerance_s=3.0)
    for stamp_ms in (0, 1_000, 3_790, 3_800):
        of.take(TOPIC, picture(stamp_ms * MS))
    assert next(taken.moment_ns for taken in of.held) == 0
    of.take(TOPIC, picture(4_100 * MS))
    of.take(TOPIC, picture(4_200 * MS))
    assert next(taken.moment_ns for taken in of.held) == 1_000 * MS
