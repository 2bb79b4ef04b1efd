"""Logs with cameras: topics that fit together, masks without OpenGL, the same whoever makes the pictures."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.maps.random_maps import clean_map
from wallkit.core.camera import camera_from_info
from wallkit.errors import SimulationError
from wallkit.logs.reader import open_log
from wallkit.pipelines.simulate.camera import NO_CLASS, render
from wallkit.pipelines.simulate.log import LogRequest, prepare, simulate_log
from wallkit.pipelines.simulate.play import START_NS
from wallkit.pipelines.simulate.preview import preview
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.scenario import CameraSetup, Scenario

FRONT = CameraSetup("front", width=96, height=72, rate_hz=4, masks="exact", pictures=False, D=(-0.2, 0.05, 0, 0, 0))
UP = CameraSetup("up", width=64, height=64, rate_hz=2, masks="exact", pictures=False, model="equidistant", hfov_deg=160)


@pytest.fixture(scope="module")
def a_map(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "m.wkmap.urdf"
    path.write_bytes(clean_map(np.random.default_rng(1)))
    return path


def request(a_map, *cameras, seed=2, duration_s=1.5):
    return LogRequest(a_map, Scenario(duration_s=duration_s, crowd=Crowd(walkers=2), cameras=cameras), seed=seed)


def images(log, topic):
    return [(m.value.stamp_ns, cv2.imdecode(np.frombuffer(m.value.data, np.uint8), -1)) for m in log.messages([topic])]


def test_masks_and_camera_info_are_recorded_without_opengl(a_map, tmp_path, monkeypatch):
    monkeypatch.setattr("wallkit.simulate.gl.probe", lambda: {"egl": "not here", "osmesa": "nor here"})
    monkeypatch.delenv("WALLKIT_GL", raising=False)
    simulate_log(request(a_map, FRONT, UP), tmp_path / "a")
    log = open_log([tmp_path / "a" / "log.mcap"])
    play = prepare(request(a_map, FRONT, UP))
    infos = [m.value for m in log.messages(["/camera/front/camera_info"])]
    camera = camera_from_info(infos[0])
    np.testing.assert_array_equal(camera.K, play.unit("front").published.K)
    np.testing.assert_array_equal(camera.D, play.unit("front").published.D)
    masks = images(log, "/oracle/front/classes")
    assert [stamp for stamp, _ in masks] == [info.stamp_ns for info in infos]
    assert len(masks) == 6
    stamp, mask = masks[3]
    shot = render(play, "front", stamp, pictures=False)
    np.testing.assert_array_equal(mask, np.where(shot.classes < 0, NO_CLASS, shot.classes))
    wide = images(log, "/oracle/up/instances")[0][1]
    assert wide.dtype == np.uint16
    names = json.loads(next(iter(log.messages(["/oracle/names"]))).value)
    seen = {names["classes"][k] for k in np.unique(mask) if k != NO_CLASS}
    assert {"wall"} <= seen <= set(play.world.class_names)
    assert "ceiling" in {names["instances"][k] for k in np.unique(wide)}


def test_pictures_without_opengl_are_one_clear_refusal_and_nothing_is_left(a_map, tmp_path, monkeypatch):
    monkeypatch.setattr("wallkit.simulate.gl.probe", lambda: {"egl": "no libEGL", "osmesa": "no OSMesa"})
    monkeypatch.delenv("WALLKIT_GL", raising=False)
    with pytest.raises(SimulationError, match=r"no libEGL.*no OSMesa") as caught:
        simulate_log(request(a_map, replace(FRONT, pictures=True)), tmp_path / "a")
    assert "apt-get install" in caught.value.hint
    assert list(tmp_path.iterdir()) == []


def test_the_same_seed_gives_the_same_masks_and_a_camera_changes_no_scan(a_map):
    plays = [prepare(request(a_map, *cameras)) for cameras in ((FRONT,), (FRONT, UP))]
    at = START_NS + 700_000_000
    one, two = (render(play, "front", at, pictures=False) for play in plays)
    np.testing.assert_array_equal(one.instances, two.instances)
    other = render(prepare(request(a_map, FRONT, seed=3)), "front", at, pictures=False)
    assert (other.instances != one.instances).any()
    np.testing.assert_array_equal(plays[0].poses, plays[1].poses)


def test_true_and_published_cameras_differ_as_the_scenario_says(a_map):
    off = replace(
        FRONT, off_mm=(10.0, 0.0, -20.0), off_deg=(0.0, 2.0, 0.0), focal_error=0.01, centre_error_px=(3.0, -2.0)
    )
    unit = prepare(request(a_map, off)).unit("front")
    moved = np.linalg.inv(unit.T_base_published) @ unit.T_base_true
    np.testing.assert_allclose(moved[:3, 3], [0.01, 0, -0.02], atol=1e-12)
    # two degrees about y, which points down: the view turns to the right
    np.testing.assert_allclose(moved[:3, 2], [np.sin(np.deg2rad(2)), 0, np.cos(np.deg2rad(2))], atol=1e-12)
    np.testing.assert_allclose(unit.true.K[0, 0] / unit.published.K[0, 0], 1.01)
    np.testing.assert_allclose(unit.true.K[:2, 2] - unit.published.K[:2, 2], [3, -2])


@pytest.mark.parametrize(
    ("cameras", "said"),
    [
        ((FRONT, FRONT), "two .* 'front'"),
        ((replace(FRONT, frame="nowhere"),), "no frame 'nowhere'"),
        ((replace(FRONT, name="x"),), "which is the camera"),
        ((replace(FRONT, K=(1.0, 2.0)),), "K = "),
        ((replace(FRONT, model="thin_prism"),), "thin_prism"),
        ((replace(FRONT, D=(1.0, 2.0)),), "coefficients"),
        ((replace(FRONT, hfov_deg=175.0),), "cannot see 175"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_with_its_reason(a_map, tmp_path, cameras, said):
    with pytest.raises(SimulationError, match=said):
        simulate_log(request(a_map, *cameras), tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_the_log_is_the_same_whoever_makes_the_pictures(gl, a_map, tmp_path):
    seen = replace(FRONT, pictures=True, masks="raster")
    for jobs in (1, 2):
        simulate_log(request(a_map, seen, duration_s=1.0), tmp_path / f"jobs{jobs}", jobs=jobs)
    one, two = ((tmp_path / f"jobs{jobs}" / "log.mcap").read_bytes() for jobs in (1, 2))
    assert one == two
    pictures = images(open_log([tmp_path / "jobs1" / "log.mcap"]), "/camera/front/image/compressed")
    assert [image.shape for _, image in pictures] == [(72, 96, 3)] * 4
    assert min(image.std() for _, image in pictures) > 5


def test_a_preview_is_a_picture_of_its_moment(a_map):
    play = prepare(request(a_map, FRONT))
    image = cv2.imdecode(np.frombuffer(preview(play, 0.5), np.uint8), -1)
    assert image.shape[0] > 300
    assert image[..., :3].std() > 20
