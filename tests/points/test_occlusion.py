"""What stands before a point as the camera sees it hides it, and a surface seen at a slant is nothing that stands before."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.camera import Camera
from wallkit.core.geometry import invert_matrix
from wallkit.points.look import LookSettings
from wallkit.points.occlusion import hidden

DEFAULT = LookSettings()
SETTINGS = {"reach_deg": DEFAULT.hidden_deg, "margin_m": DEFAULT.hidden_m, "slant_deg": DEFAULT.hidden_slant_deg}
LIDAR = np.array([0.0, 0.0, 0.35])
# the camera looks along x: 0.3 m above the LiDAR, or beside it as well
ABOVE, ASIDE = LIDAR + (0.1, 0.0, 0.3), LIDAR + (0.1, 0.3, 0.3)
CAMERA_AXES = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
NOISE_M = 0.02


def camera(focal, model="plumb_bob"):
    K = np.array([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1.0]])
    return Camera(model, 640, 480, K, np.zeros(5 if model == "plumb_bob" else 4))


def looking_from(eye):
    """(4, 4) T_camera_world of a camera at `eye`."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = CAMERA_AXES, eye
    return invert_matrix(T)


def beams(rings, *, up_deg=15.0, step_deg=0.25):
    """(P, 3) directions of a LiDAR with so many rings, evenly from -up_deg to up_deg."""
    turn, up = np.meshgrid(np.deg2rad(np.arange(-90, 90, step_deg)), np.deg2rad(np.linspace(-up_deg, up_deg, rings)))
    return np.stack([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)], axis=-1).reshape(-1, 3)


def met(origin, directions, planes, boxes=()):
    """(P,) how far along each direction the first of the planes n x = d and upright boxes (low, high) is met."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = [(d - origin @ np.array(n)) / (directions @ np.array(n)) for n, d in planes]
        for low, high in boxes:
            a, b = (low - origin) / directions, (high - origin) / directions
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            found.append(np.where(enter <= leave, enter, np.inf))
    return np.min([np.where(far > 1e-6, far, np.inf) for far in found], axis=0)


def seen(planes, boxes=(), *, rings=31, eye=ABOVE, focal=300.0, noise_m=0.0, farthest_m=30.0):
    """Returns at 0.2 to 0.5 m (K, 3), which of them are called hidden, and which truly are; only those on the image."""
    rng, directions = np.random.default_rng(7), beams(rings)
    ranges = met(LIDAR, directions, planes, boxes)
    directions, ranges = directions[ranges < farthest_m], ranges[ranges < farthest_m]
    cloud = (LIDAR + directions * (ranges + rng.normal(0, noise_m, len(ranges)))[:, None]).astype(np.float32)
    T, lens = looking_from(eye), camera(focal)
    points = cloud[(cloud[:, 2] > 0.2) & (cloud[:, 2] < 0.5)]
    points = points[lens.is_inside(lens.project(points @ T[:3, :3].T + T[:3, 3]))]
    away = points - eye
    far = np.linalg.norm(away, axis=1)
    truth = met(eye, away / far[:, None], planes, boxes) < far - 0.05 - 3 * noise_m
    return points, hidden(lens, T, points, cloud, **SETTINGS), truth


def corridor(half_m, end_m=12.0):
    upright = [((0, 1, 0), half_m), ((0, 1, 0), -half_m), ((1, 0, 0), end_m), ((1, 0, 0), -end_m)]
    return [*upright, ((0, 0, 1), 0.0), ((0, 0, 1), 2.6)]


def wall(slant_deg, far_m=5.0):
    """The plane through a point so far ahead whose normal is turned from the line of sight, on the floor."""
    n = np.array([np.cos(np.deg2rad(slant_deg)), np.sin(np.deg2rad(slant_deg)), 0])
    return [(n, far_m * n[0]), ((0, 0, 1), 0.0)]


@pytest.mark.parametrize("noise_m", [0.0, NOISE_M])
@pytest.mark.parametrize("rings", [16, 64])
@pytest.mark.parametrize("half_m", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("focal", [300.0, 500.0, 800.0])
def test_an_empty_corridor_hides_nothing_of_itself(focal, half_m, rings, noise_m):
    """A room without reflex corners: from inside, every point of it is seen. At 12 m a wall 1 m aside is seen at 85 deg."""
    points, found, truth = seen(corridor(half_m), rings=rings, focal=focal, noise_m=noise_m)
    assert len(points) > 5
    assert not truth.any()
    assert not found.any()


@pytest.mark.parametrize("model", ["plumb_bob", "equidistant"])
def test_a_plane_hides_nothing_of_itself_up_to_the_angle_that_it_is_asked_for(model):
    """However densely it is seen, in whatever direction it is tilted, near and far; and a little beyond that it does."""
    lens, T = camera(300.0, model), looking_from(np.zeros(3))
    for tilt in np.deg2rad(np.arange(0, 360, 30)):
        for far_m, slant_deg in ((2.0, 0), (2.0, 60), (8.0, 80), (2.0, 84), (8.0, 84), (8.0, 87)):
            slant = np.deg2rad(slant_deg)
            n = np.array([np.cos(slant), np.sin(slant) * np.cos(tilt), np.sin(slant) * np.sin(tilt)])
            aside = np.stack(np.meshgrid(*[np.tan(np.deg2rad(np.linspace(-1, 1, 41)))] * 2), axis=-1).reshape(-1, 2)
            rays = np.column_stack([np.ones(len(aside)), aside])
            rays = rays[rays @ n > 0.01]
            plane = (rays * (far_m * n[0] / (rays @ n))[:, None]).astype(np.float32)
            seen_at = np.rad2deg(np.arccos(rays @ n / np.linalg.norm(rays, axis=1)))
            found = hidden(lens, T, plane, plane, reach_deg=1.2, margin_m=0.0, slant_deg=85.0)
            assert not found[seen_at < 85].any()
            assert found[seen_at > 86].any() == (slant_deg == 87)


@pytest.mark.parametrize("focal", [300.0, 500.0])
@pytest.mark.parametrize("slant_deg", [0, 30, 60, 75])
def test_a_wall_at_a_slant_hides_nothing_of_itself(slant_deg, focal):
    points, found, truth = seen(wall(slant_deg), focal=focal, noise_m=NOISE_M)
    n, away = wall(slant_deg)[0][0], points - ABOVE
    on_wall = np.abs(points @ n - wall(slant_deg)[0][1]) < 0.1
    flat_deg = np.rad2deg(np.arccos(np.abs(away @ n) / np.linalg.norm(away, axis=1)))
    assert not truth.any()
    assert (on_wall & (flat_deg < 80)).sum() > 40
    assert not found[flat_deg < 80].any()


@pytest.mark.parametrize("gap_m", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("rings", [16, 31])
@pytest.mark.parametrize("slant_deg", [0, 60])
@pytest.mark.parametrize("focal", [300.0, 500.0])
def test_a_person_before_a_wall_hides_it(focal, slant_deg, rings, gap_m):
    """Truth is whether a box stands between eye and return; 0.2 m and more beside its shadow nothing may be hidden."""
    n, d = wall(slant_deg)[0]
    behind, told, clear, wrong = 0, 0, 0, 0
    for y in np.arange(-1.0, 1.01, 0.25):
        x = 5.0 - gap_m - y * np.tan(np.deg2rad(slant_deg))  # so far before the wall wherever it stands
        if not 1.5 < x < 8:
            continue
        body = np.array([x - 0.25, y - 0.25, 0]), np.array([x, y + 0.25, 1.7])
        wider = body[0] - (0, 0.2, 0), body[1] + (0, 0.2, 0)
        points, found, truth = seen(wall(slant_deg), [body], rings=rings, eye=ASIDE, focal=focal)
        on_wall, away = np.abs(points @ n - d) < 0.01, points - ASIDE
        far = np.linalg.norm(away, axis=1)
        is_clear = on_wall & (met(ASIDE, away / far[:, None], wall(slant_deg), [wider]) > far - 0.01)
        is_clear &= np.abs(away @ n) / far > np.cos(np.deg2rad(80))
        behind, told = behind + (on_wall & truth).sum(), told + (on_wall & truth & found).sum()
        clear, wrong = clear + is_clear.sum(), wrong + (is_clear & found).sum()
    assert behind > 10
    assert told == behind
    assert clear > 300
    assert wrong == 0


def test_under_a_low_camera_the_floor_hides_no_wall():
    """The floor is seen flatter than any wall, and lies before the foot of each; but it is all below the line of sight."""
    low = LIDAR + (0.1, 0.0, -0.05)
    for far_m in (4.0, 8.0, 12.0):
        points, found, _ = seen(wall(0, far_m), rings=64, eye=low)
        assert (points[:, 0] > far_m - 0.1).any()
        assert not found.any()


def test_what_is_behind_a_board_is_hidden():
    """A board at 2 m before a wall at 5 m; the camera half a metre to the left of the LiDAR sees past its edge."""
    eye, lens = np.array([0.0, 0.5, 0.0]), camera(300.0)
    y, z = np.meshgrid(np.linspace(-3, 3, 241), np.linspace(-1, 1, 81))
    behind = np.column_stack([np.full(y.size, 5.0), y.ravel(), z.ravel()])
    board = np.column_stack([np.full(y.size, 2.0), y.ravel() / 10, z.ravel()])
    T, both = looking_from(eye), np.concatenate([behind, board])
    found = hidden(lens, T, behind, both, **SETTINGS)
    # where the sight line crosses the board's plane, seen from above; 1.2 deg at 2 m are 4.2 cm
    crossing = eye[1] + (behind[:, 1] - eye[1]) * 2 / 5
    within = np.linalg.norm((behind - eye)[:, :2], axis=1) / 5
    inside = lens.is_inside(lens.project(behind @ T[:3, :3].T + T[:3, 3]))
    assert found[inside & (np.abs(crossing) < 0.3)].all()
    assert not found[np.abs(crossing) > 0.3 + 0.042 * within * 1.1].any()
    assert not found[~inside].any()
    assert not hidden(lens, T, board, both, **SETTINGS).any()


def test_a_point_hides_what_has_it_in_a_narrow_cone():
    """From 5 m, 1.1 m before the point, of which 0.1 are margin: 5 deg about the line of sight are 8.7 cm there."""
    lens, T, point = camera(300.0), looking_from(np.zeros(3)), np.array([[5.0, 0, 0]])
    wide = SETTINGS | {"reach_deg": 5.0, "margin_m": 0.1}

    def is_hidden_by(*other, **settings):
        return bool(hidden(lens, T, point, np.array([other]), **wide | settings)[0])

    for y, z in ((1, 0), (-1, 0), (0, 1), (0.6, -0.8)):
        assert is_hidden_by(3.9, 0.087 * y, 0.087 * z)
        assert not is_hidden_by(3.9, 0.088 * y, 0.088 * z)
        # 1.27 deg from the line of sight, as the camera sees it
        assert is_hidden_by(3.9, 0.0865 * y, 0.0865 * z, reach_deg=1.3)
        assert not is_hidden_by(3.9, 0.0865 * y, 0.0865 * z, reach_deg=1.2)
    assert is_hidden_by(4.899, 0, 0)
    assert not is_hidden_by(4.901, 0, 0)
    assert not is_hidden_by(5.5, 0, 0)
    assert not is_hidden_by(-1.0, 0, 0)
    assert not is_hidden_by(3.9, 0, 0, slant_deg=90.0)
