"""Cameras in drawn rooms: what each pixel shows is what an independent projection says, by rays and by the renderer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.simulate.drawn import room, standing
from wallkit.core.camera import Camera
from wallkit.simulate.camera import Unit, photograph, solids_by_raster, solids_by_rays
from wallkit.simulate.looks import Looks, Wardrobe
from wallkit.simulate.optics import optics_of
from wallkit.simulate.photo import PERFECT, Photo, developed
from wallkit.simulate.scenario import Scenario
from wallkit.simulate.scene import NOTHING, Scene
from wallkit.simulate.stage import staged
from wallkit.simulate.studio import Studio
from wallkit.simulate.world import Solid, upright

W, H = 160, 120
LENSES = {
    "pinhole": ("plumb_bob", (110.0, 115.0, 74.3, 66.1), (0.0,) * 5),
    "plumb_bob": ("plumb_bob", (110.0, 108.0, 78.2, 61.7), (-0.28, 0.07, 0.002, -0.001, 0.0)),
    "rational": ("rational_polynomial", (100.0, 100.0, 80.0, 60.0), (0.3, 0.02, 0.001, 0.0, 0.001, 0.5, 0.05, 0.004)),
    "fisheye": ("equidistant", (52.0, 52.0, 80.4, 59.2), (0.02, -0.008, 0.001, 0.0)),
}
# x right, y down, z forward, looking along the map's +x from (1, 2, 1.2)
AHEAD = np.array([[0, 0, 1.0, 1.0], [-1, 0, 0, 2.0], [0, -1, 0, 1.2], [0, 0, 0, 1]])


def unit(name="pinhole", **more):
    model, (fx, fy, cx, cy), D = LENSES[name]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    camera = Camera(model, W, H, K, np.array(D), "test", "optical")
    return Unit("test", "optical", camera, camera, np.eye(4), np.eye(4), **{"photo": PERFECT, **more})


def turned(yaw, pitch=0.0, roll=0.0):
    from scipy.spatial.transform import Rotation

    T = AHEAD.copy()
    T[:3, :3] = AHEAD[:3, :3] @ Rotation.from_euler("yxz", [yaw, pitch, roll]).as_matrix()
    return T


def ball(name, x, y, z, r=0.05):
    return Solid(name, "unknown", "sphere", (r,), upright(x, y, 0.0, z))


BALLS = [
    ball(f"ball_{k}", *at) for k, at in enumerate([(3, 2.9, 1.7), (3, 1.1, 0.8), (2.5, 2.1, 1.2), (2.2, 1.5, 1.9)])
]
FURNISHED = (
    standing("cupboard", (0.5, 1.0, 1.1), 4.5, 3.0, 0.4),
    standing("sink", (0.4, 0.5, 0.8), 4.0, 0.6, 1.57, class_name="sink"),
    *BALLS,
)


def studio(world, seed=3, **looks):
    return Studio(Wardrobe(world, Looks(**looks), seed), samples=0)


def near_edges(labels, px=2):
    import cv2

    edge = np.zeros(labels.shape, bool)
    across, down = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= down
    edge[:-1] |= down
    return cv2.dilate(edge.astype(np.uint8), np.ones((2 * px + 1, 2 * px + 1), np.uint8)) > 0


@pytest.mark.parametrize("lens", LENSES)
def test_rays_show_a_ball_where_the_camera_projects_it(lens):
    scene, eye, T = Scene(room(6, 4, *BALLS)), unit(lens), turned(0.05, -0.04, 0.1)
    solids = solids_by_rays(scene, eye, T)
    seen = 0
    for number, solid in enumerate(scene.world.solids):
        pixel = eye.true.project((np.linalg.inv(T) @ solid.T_body_solid[:, 3])[:3])
        if solid.kind != "sphere" or not (10 < pixel[0] < W - 10 and 10 < pixel[1] < H - 10):
            continue
        rows, columns = np.nonzero(solids == number)
        # the picture of a ball is an ellipse whose middle is near its centre's pixel
        np.testing.assert_allclose([columns.mean(), rows.mean()], pixel, atol=0.6)
        seen += 1
    assert seen >= 2


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_look_where_the_lens_says(lens):
    optics = optics_of(unit(lens).true)
    v, u = np.nonzero(optics.sees)
    np.testing.assert_allclose(unit(lens).true.project(optics.rays[v, u]), np.column_stack([u, v]), atol=1e-6)
    if optics.columns is None:
        return
    # and the sheet's pinholes find the same rays
    above = 0
    for eye, R in optics.eyes:
        here = (optics.rows >= above) & (optics.rows < above + eye.height) & optics.sees
        x = (optics.columns[here] - eye.cx) / eye.fx
        y = (optics.rows[here] - above - eye.cy) / eye.fy
        above += eye.height
        rays = np.column_stack([x, y, np.ones_like(x)]) @ R.T
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        np.testing.assert_allclose(rays, optics.rays[here], atol=1e-5)


@pytest.mark.parametrize("lens", LENSES)
def test_the_renderer_shows_what_rays_meet_but_for_edges(gl, lens):
    world = staged(room(6, 4, *FURNISHED), Scenario())
    scene = Scene(world)
    with studio(world) as stage:
        for yaw, pitch in ((0.1, 0.0), (0.6, -0.3), (-0.7, 0.5), (3.0, 0.2)):
            T = turned(yaw, pitch, 0.05)
            exact = solids_by_rays(scene, unit(lens), T)
            drawn = solids_by_raster(stage, unit(lens), T)
            off = exact != drawn
            assert off.mean() < 0.02
            assert not (off & ~near_edges(exact) & ~near_edges(drawn)).any()


@pytest.mark.parametrize("lens", LENSES)
def test_a_picture_shows_a_ball_where_the_camera_projects_it(gl, lens):
    """In colours, through the renderer, the lens and the principal point: a glowing ball against the dark."""
    world = staged(room(6, 4, *BALLS[:1]), Scenario())
    with studio(world, brightness=0.05) as stage:
        ball_material = stage.model.geom_matid[np.flatnonzero(stage.solid_of_geom == 4)[0]]
        stage.model.mat_texid[:] = -1
        stage.model.mat_rgba[:] = (0, 0, 0, 1)
        stage.model.mat_rgba[ball_material] = (1, 1, 1, 1)
        stage.model.mat_emission[ball_material] = 1.0
        for yaw in (0.0, -0.4):
            T = turned(yaw, 0.1, 0.2)
            image = photograph(np.random.default_rng(0), stage, unit(lens), [T]).astype(float)[..., 0]
            in_camera = np.linalg.inv(T) @ world.solids[4].T_body_solid[:, 3]
            weights = np.where(image > 60, image, 0.0)
            v, u = np.mgrid[:H, :W]
            middle = [(u * weights).sum() / weights.sum(), (v * weights).sum() / weights.sum()]
            np.testing.assert_allclose(middle, unit(lens).true.project(in_camera[:3]), atol=0.4)


def test_a_mirror_is_a_mirror_and_glass_is_what_was_asked_for():
    pane = replace(standing("pane", (0.02, 4.0, 2.5), 3.0, 2.0, class_name="glass"), light="glass")
    mirror = replace(standing("mirror", (0.02, 1.0, 2.0), 5.9, 2.0, class_name="mirror"), light="mirror")
    scene = Scene(room(6, 4, pane, mirror))
    names = [solid.instance for solid in scene.world.solids]
    middle = (H // 2, W // 2)
    assert names[solids_by_rays(scene, unit(), AHEAD)[middle]] == "pane"
    assert names[solids_by_rays(scene, unit(glass="through"), AHEAD)[middle]] == "mirror"


def test_a_camera_sees_what_no_lidar_meets():
    veil = replace(standing("veil", (0.02, 4.0, 2.5), 3.0, 2.0, class_name="unknown"), light="none")
    scene = Scene(room(6, 4, veil))
    assert scene.world.solids[solids_by_rays(scene, unit(), AHEAD)[60, 80]].instance == "veil"
    assert scene.cast(AHEAD[:3, 3], np.array([[1.0, 0, 0]])).solids[0] != len(scene.world.solids) - 1


def test_beyond_its_lens_a_camera_sees_nothing():
    narrow = unit("fisheye")
    K = narrow.true.K.copy()
    K[0, 0] = K[1, 1] = 20.0
    camera = Camera("equidistant", W, H, K, np.zeros(4))
    solids = solids_by_rays(Scene(room()), replace(narrow, true=camera), AHEAD)
    assert solids[0, 0] == NOTHING
    assert solids[60, 80] != NOTHING


def test_the_same_seed_dresses_a_world_the_same_and_one_more_thing_changes_nothing_else():
    world = staged(room(6, 4, *FURNISHED), Scenario())
    more = staged(room(6, 4, *FURNISHED, standing("bin", (0.3, 0.3, 0.5), 1, 1)), Scenario())
    number = next(k for k, solid in enumerate(world.solids) if solid.instance == "cupboard")
    one, two, other = (
        Wardrobe(w, Looks(), seed).plain(w.solids[number]).texture for w, seed in ((world, 1), (more, 1), (world, 2))
    )
    np.testing.assert_array_equal(one.pixels, two.pixels)
    assert (one.pixels != other.pixels).any()


def test_a_perfect_camera_changes_nothing_and_noise_has_the_spread_it_claims():
    grey = np.full((H, W, 3), 128, dtype=np.uint8)
    np.testing.assert_array_equal(developed(np.random.default_rng(0), PERFECT, grey), grey)
    noisy = developed(np.random.default_rng(0), replace(PERFECT, read_noise=0.01), grey).astype(float) / 255
    # of light: through the slope of the encoding x^(1/2.2)
    light = (128 / 255) ** 2.2
    assert noisy.std() == pytest.approx(0.01 / 2.2 * light ** (1 / 2.2 - 1), rel=0.05)
    dark = developed(np.random.default_rng(0), Photo(vignette=0.5, read_noise=0, shot_noise=0), grey)
    assert dark[0, 0, 0] < dark[H // 2, W // 2, 0]
