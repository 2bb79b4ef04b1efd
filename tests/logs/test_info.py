"""What a log is said to hold, and whether it can be localized."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from tests.logs.drawn import SECOND_NS, START_NS, drive, log_of, write
from wallkit.core.types import OccupancyGrid, StampedPose
from wallkit.logs.info import describe
from wallkit.logs.reader import open_log
from wallkit.logs.rig import Wanted

DRIVE = log_of(drive(), seconds=2)
EIGHT_DAYS_NS = 8 * 86400 * SECOND_NS


def info_of(tmp_path, messages, wanted=None, **options):
    return describe(open_log([write(tmp_path / "log.mcap", messages, **options)]), wanted)


def test_topics_rates_gaps_and_clocks(tmp_path):
    hole = [m for m in DRIVE if not (m[1] == "/odom" and START_NS + SECOND_NS < m[0] < START_NS + 1.5 * SECOND_NS)]
    info = info_of(tmp_path, hole, log_offset_ns=EIGHT_DAYS_NS)
    topics = {t.topic: t for t in info.topics}
    assert topics["/scan"].count == 10
    assert topics["/scan"].rate_hz == pytest.approx(5.0)
    assert topics["/scan"].frames == ("laser",)
    assert topics["/odom"].longest_gap_s == pytest.approx(0.5)
    assert topics["/odom"].gap_at_ns == START_NS + SECOND_NS
    assert topics["/tf_static"].frames == ("base_link->laser",)
    assert topics["/odom"].clock_offset_s == pytest.approx((8 * 86400, 8 * 86400))
    assert info.duration_s == pytest.approx(2.0)
    assert info.start_ns == START_NS
    assert info.is_clock_absolute
    assert info.transforms == (("base_link", "laser", True),)


def test_it_can_be_localized(tmp_path):
    extra = [
        (START_NS, "/map", OccupancyGrid(np.zeros((2, 2), np.int8), 0.1, np.zeros(3), "/map", START_NS)),
        (START_NS, "/initialpose", StampedPose(START_NS, "map", np.zeros(3), np.eye(3))),
        (START_NS, "/ground_truth/pose", StampedPose(START_NS, "map", np.zeros(3))),
    ]
    info = info_of(tmp_path, [*extra, *DRIVE])
    assert info.can_localize
    assert info.reasons == ()
    assert (info.scan, info.odometry, info.mount) == ("/scan", "/odom", "/tf_static")
    assert (info.truth, info.initial_pose, info.maps) == ("/ground_truth/pose", "/initialpose", ("/map",))
    json.dumps(asdict(info), allow_nan=False)


@pytest.mark.parametrize(
    ("topics", "words"),
    [
        ({"/odom", "/tf_static"}, ["LiDAR scan"]),
        ({"/scan", "/tf_static"}, ["odometry"]),
        ({"/tf_static"}, ["LiDAR scan", "odometry"]),
        ({"/scan", "/odom"}, ["where the LiDAR 'laser' sits"]),
    ],
)
def test_why_it_cannot_be_localized(tmp_path, topics, words):
    info = info_of(tmp_path, [m for m in DRIVE if m[1] in topics])
    assert not info.can_localize
    assert len(info.reasons) == len(words)
    assert all(word in reason for word, reason in zip(words, info.reasons, strict=True))


def test_what_the_user_names_counts(tmp_path):
    bare = [m for m in DRIVE if m[1] != "/tf_static"]
    assert not info_of(tmp_path, bare).can_localize
    assert info_of(tmp_path, bare, Wanted(lidar_pose="0,0,0")).mount == "--lidar-pose"


def test_clocks_that_never_meet(tmp_path):
    apart = [(s, t, replace(v, stamp_ns=v.stamp_ns - EIGHT_DAYS_NS) if t == "/odom" else v) for s, t, v in DRIVE]
    info = info_of(tmp_path, apart)
    assert not info.can_localize
    assert "never overlap" in info.reasons[0]


def test_a_clock_that_counts_from_switching_on(tmp_path):
    early = [(m[0] - START_NS + SECOND_NS, m[1], m[2]) for m in DRIVE]
    early = [(s, t, v if isinstance(v, tuple) else replace(v, stamp_ns=s)) for s, t, v in early]
    info = info_of(tmp_path, early)
    assert not info.is_clock_absolute
    assert info.start_ns == SECOND_NS


def test_a_log_of_nothing(tmp_path):
    info = info_of(tmp_path, [(START_NS, "/robot_description", "hello")])
    assert (info.start_ns, info.end_ns, info.duration_s) == (None, None, 0.0)
    assert not info.can_localize
