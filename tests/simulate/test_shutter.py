"""Rolling shutter and auto exposure that lags: each is what pictures of other moments say it must be."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from wallkit.pipelines.simulate.camera import render
from wallkit.pipelines.simulate.log import LogRequest, prepare
from wallkit.pipelines.simulate.play import START_NS
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.photo import PERFECT, developed
from wallkit.simulate.scenario import CameraSetup, Scenario

H, W, READOUT_S, STRIPS = 48, 64, 0.04, 6
TURN_RAD_S = 1.5
AT_NS = START_NS + 600_000_000


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    """A robot that turns on the spot among people."""
    path = tmp_path_factory.mktemp("map") / "m.wkmap.urdf"
    path.write_bytes(clean_map(np.random.default_rng(1)))
    camera = CameraSetup("front", width=W, height=H, photo=PERFECT)
    play = prepare(LogRequest(path, Scenario(duration_s=1.5, crowd=Crowd(walkers=3), cameras=(camera,)), seed=2))
    poses = np.repeat(play.poses[:1], len(play.poses), axis=0)
    poses[:, 2] += TURN_RAD_S * (play.stamps_ns - START_NS) / 1e9
    yield (turning := replace(play, poses=poses))
    turning.close()


def strips():
    """Row from, row to, and when they are read."""
    for a, b in pairwise(range(0, H + 1, H // STRIPS)):
        yield a, b, AT_NS + round(((a + b) / 2 / H - 0.5) * READOUT_S * 1e9)


def rolling(play):
    unit = play.unit("front")
    return unit.developing(replace(unit.photo, readout_s=READOUT_S, strips=STRIPS))


@pytest.mark.parametrize("masks", ["exact", "raster"])
def test_every_strip_shows_its_own_moment(gl, play, masks):
    whole = render(play, rolling(play), AT_NS, masks=masks)
    for a, b, at_ns in strips():
        then = render(play, "front", at_ns, masks=masks)
        np.testing.assert_array_equal(whole.instances[a:b], then.instances[a:b])
        np.testing.assert_array_equal(whole.image[a:b], then.image[a:b])
    assert (whole.instances != render(play, "front", AT_NS, masks=masks).instances).any()


def test_an_upright_edge_leans_as_the_robot_turns(play):
    """Left while the rows go by: what stands still moves to the right, by focal length x turn x time."""
    focal = play.unit("front").true.K[0, 0]
    first, last = (
        render(play, "front", at_ns, pictures=False).instances for _, _, at_ns in (*strips(),)[:: STRIPS - 1]
    )
    whole = render(play, rolling(play), AT_NS, pictures=False).instances
    np.testing.assert_array_equal(whole[0], first[0])
    np.testing.assert_array_equal(whole[-1], last[-1])
    moved = focal * TURN_RAD_S * READOUT_S * (STRIPS - 1) / STRIPS
    rows = [first[H // 2], last[H // 2]]
    agree = [np.mean(rows[0][: W - k] == rows[1][k:]) for k in range(8)]
    assert abs(int(np.argmax(agree)) - moved) < 1.5


def test_auto_exposure_goes_by_the_light_of_before(gl, play):
    photo = replace(PERFECT, auto_exposure=1.0, exposure_lag_s=0.5)
    unit = play.unit("front").developing(photo)
    image = render(play, unit, AT_NS, masks="none").image
    now, before = (render(play, "front", AT_NS - lag, masks="none").image for lag in (0, 500_000_000))
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(image, developed(rng, photo, now, metered=before))
    assert (image != developed(rng, photo, now)).any()


def test_in_steady_light_the_lag_changes_nothing():
    grey = np.full((H, W, 3), 60, dtype=np.uint8)
    photo = replace(PERFECT, auto_exposure=0.8)
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(developed(rng, photo, grey, metered=grey), developed(rng, photo, grey))
    assert (developed(rng, photo, grey, metered=grey // 2) > developed(rng, photo, grey)).all()
