"""Several runs over one log: the frames, reports and answers are those of runs that read the log themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.e2e import camera_log
from wallkit.logs.reader import Log
from wallkit.pipelines.cameras import CameraRequest
from wallkit.pipelines.config import load_config
from wallkit.pipelines.localize import Request, localize, prepare
from wallkit.pipelines.shared import Shared


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log whose last part was cut off: something of it is lost."""
    path = tmp_path_factory.mktemp("shared") / "log.mcap"
    camera_log.write_log(path, seconds=5)
    path.write_bytes(path.read_bytes()[:-20000])
    camera_log.write_calibration(path.with_name("front.toml"))
    return path


@pytest.fixture
def passes(monkeypatch):
    """How often a log has been read for its scans."""
    counted = []
    decoded = Log.decoded

    def spy(self, topics=None):
        if topics is not None and len(topics) > 1:
            counted.append(topics)
        return decoded(self, topics)

    monkeypatch.setattr(Log, "decoded", spy)
    return counted


def run(log, filters, *, seed=0, words=(), shared=None, **request):
    given = {"points.filters": (filters, "--filter")}
    config = load_config(None, ["localize.particles=200", *words], given).config
    cameras = (
        CameraRequest((log.with_name("front.toml"),), model="oracle") if "wall_mask" in filters else CameraRequest()
    )
    asked = Request((log,), init="truth", cameras=cameras, seed=seed, **request)
    return localize(prepare(asked, config, shared=shared))


def assert_same(one, other):
    np.testing.assert_array_equal(one.steps.poses, other.steps.poses)
    np.testing.assert_array_equal(one.odometry.poses, other.odometry.poses)
    assert one.sync == other.sync
    assert one.loss == other.loss
    assert one.loss.lines()
    if one.filtering is not None:
        assert one.filtering.by_class == other.filtering.by_class


RUNS = [
    {"filters": ("wall_mask",)},
    {"filters": ()},
    {"filters": ("line_fit",), "seed": 1},
    {"filters": ("wall_mask",), "seed": 2},
    {"filters": (), "words": ("logs.range_max_m=3",)},
    {"filters": (), "end_s": 2.0},
]


def test_runs_that_share_say_what_each_says_alone(log, passes):
    alone = [run(log, **given) for given in RUNS]
    passes.clear()
    shared = Shared()
    together = [run(log, **given, shared=shared) for given in RUNS]
    for one, other in zip(alone, together, strict=True):
        assert_same(one, other)
    # with and without the camera, with another range, and of another window
    assert len(passes) == 4


def test_frames_that_do_not_fit_are_read_again(log, passes):
    small, alone = Shared(limit_mb=0.5), run(log, ("wall_mask",))
    passes.clear()
    for _ in range(2):
        assert_same(alone, run(log, ("wall_mask",), shared=small))
    assert len(passes) == 2


def test_a_run_that_breaks_off_leaves_no_half_log(log):
    shared, config = Shared(), load_config(None, ["localize.particles=200"]).config
    broken = prepare(Request((log,), init="truth"), config, shared=shared)

    def stop(done):
        if done == 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        localize(broken, observe=stop)
    assert_same(run(log, ()), run(log, (), shared=shared))


def test_seeds_read_the_log_once(log, passes):
    config = load_config(None, ["localize.particles=200"]).config
    prepared = prepare(Request((log,), init="truth"), config, seeds=3)
    passes.clear()
    for seed in range(3):
        localize(replace(prepared, request=replace(prepared.request, seed=seed)))
    assert len(passes) == 1
