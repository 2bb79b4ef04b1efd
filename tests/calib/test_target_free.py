"""Rooms drawn with what they reflect: the checks find the true transform, notice a wrong one, and name what they see."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.calib.extrinsics.worlds import UPRIGHT
from wallkit.calib.verify.free import lowest, moved, profile_gate, profiles
from wallkit.calib.verify.free_lines import edges_of_scan, floor_offsets, lines_gate, vertical_offsets
from wallkit.calib.verify.free_nid import nid_frame, nid_scores
from wallkit.core.camera import Camera

K = np.array([[400.0, 0, 320], [0, 400, 240], [0, 0, 1]])
CAMERA = Camera("plumb_bob", 640, 480, K, np.zeros(5))
T = np.eye(4)
T[:3, :3], T[:3, 3] = UPRIGHT, (0.02, 0.1, -0.05)
HEIGHT_M = 0.3


def test_a_parabola_is_lowest_where_it_is():
    x = np.linspace(-1, 1, 9)
    assert lowest(x, (x - 0.13) ** 2) == pytest.approx(0.13, abs=1e-12)
    assert lowest(x, -x) == 1.0


def painted_room(seed):
    """A cloud on two walls with patches of paint, and the picture of it; nearer wall to the left."""
    rng = np.random.default_rng(seed)
    paint = cv2.resize(rng.uniform(0, 1, (14, 40)).astype(np.float32), (1200, 420), interpolation=cv2.INTER_NEAREST)
    az, el = np.meshgrid(np.radians(np.linspace(-42, 42, 420)), np.radians(np.linspace(-22, 22, 32)))
    beams = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1).reshape(-1, 3)
    points, strength = hit(beams, np.zeros(3), paint)
    v, u = np.mgrid[0:480, 0:640]
    rays = CAMERA.unproject(np.stack([u, v], -1).reshape(-1, 2)) @ T[:3, :3]
    _, grey = hit(rays, -T[:3, :3].T @ T[:3, 3], paint)
    picture = (40 + 180 * grey.reshape(480, 640) ** 0.7).astype(np.uint8)
    return points, strength * 97 + 3, picture


def hit(beams, origin, paint):
    """Where rays meet the walls x = 3 and, to the left of a slanted edge, x = 2; and the paint there."""
    far = (3.0 - origin[0]) / beams[:, 0]
    near = (2.0 - origin[0]) / beams[:, 0]
    at_near = origin + beams * near[:, None]
    is_near = at_near[:, 1] > 0.3 + 0.5 * at_near[:, 2]
    points = np.where(is_near[:, None], at_near, origin + beams * far[:, None])
    column = ((points[:, 1] + 4) / 8 * 1200).clip(0, 1199).astype(int)
    row = ((points[:, 2] + 2) / 4 * 420).clip(0, 419).astype(int)
    return points, paint[row, column] * np.where(is_near, 0.6, 1.0)


@pytest.fixture(scope="module")
def rooms():
    return [painted_room(seed) for seed in range(4)]


def nid_gate(rooms, place):
    frames = [nid_frame(CAMERA, place, grey, points, strength) for points, strength, grey in rooms]
    found = profiles(place, lambda t: nid_scores(CAMERA, t, frames), len(frames))
    return profile_gate("NID", found, basis=""), {profile.axis: profile for profile in found}


def test_nid_is_least_at_the_truth(rooms):
    gate, found = nid_gate(rooms, T)
    assert gate.verdict == "PASS"
    assert "yaw" in gate.name
    assert "pitch" in gate.name
    for axis in ("yaw", "pitch", "roll"):
        assert abs(np.degrees(found[axis].minimum)) < 0.15
    for axis in ("left", "height"):
        assert abs(found[axis].minimum) < 0.02


@pytest.mark.parametrize(("axis", "name"), [(1, "pitch"), (2, "yaw")])
def test_nid_contradicts_a_wrong_turn_and_names_it(rooms, axis, name):
    gate, _ = nid_gate(rooms, moved(T, axis, np.radians(0.95)))
    assert gate.verdict == "FAIL"
    assert f"agree best with {name} -" in gate.reason


def test_nid_cannot_tell_without_structure(rooms):
    rng = np.random.default_rng(0)
    blank = [(points, rng.uniform(0, 1, len(points)), np.full((480, 640), 128, np.uint8)) for points, _, _ in rooms]
    assert nid_gate(blank, T)[0].verdict == "CANNOT TELL"


def test_what_the_camera_cannot_see_is_left_out(rooms):
    """Behind the nearer wall nothing is seen, however the LiDAR sees it."""
    points, strength, grey = rooms[0]
    sight = -T[:3, :3].T @ T[:3, 3]
    hidden = sight + (points[(points[:, 0] < 2.1)][:50] - sight) * 1.6
    both = nid_frame(CAMERA, T, grey, np.concatenate([points, hidden]), np.concatenate([strength, np.ones(50)]))
    alone = nid_frame(CAMERA, T, grey, points, strength)
    assert len(both.points_m) == len(alone.points_m)


# ------------------------------------------------------------------------------------------------ lines


def corridor(seed, place=T):
    """A scan of a room with a pillar and a niche, in the order of bearing, and a picture of grey walls with dark edges."""
    rng = np.random.default_rng(seed)
    side, depth, pillar = rng.uniform(1.0, 1.4), rng.uniform(3.5, 4.5), rng.uniform(-0.5, 0.3)
    walls = [
        ((depth, -side), (depth, side)),
        ((0.3, side), (depth, side)),
        ((0.3, -side), (depth, -side)),
        ((2.2, pillar), (2.2, pillar + 0.3)),
        ((2.2, pillar), (2.5, pillar)),
        ((2.2, pillar + 0.3), (2.5, pillar + 0.3)),
    ]
    azimuth = np.radians(np.arange(-60, 60, 0.25))
    ranges = np.full(len(azimuth), np.inf)
    for p, q in walls:
        ranges = np.minimum(ranges, meets(azimuth, np.array(p), np.array(q)))
    ranges = ranges + rng.normal(0, 0.004, len(ranges))
    scan = np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), np.zeros(len(azimuth))])
    v, u = np.mgrid[0:480, 0:640]
    rays = CAMERA.unproject(np.stack([u, v], -1).reshape(-1, 2)) @ place[:3, :3]
    eye = -place[:3, :3].T @ place[:3, 3]
    return scan, shaded(rays, eye, walls, rng)


def meets(azimuth, p, q, origin=(0.0, 0.0)):
    d = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    s, o = q - p, p - np.array(origin)
    det = d[:, 0] * s[1] - d[:, 1] * s[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (o[0] * s[1] - o[1] * s[0]) / det
        share = (o[0] * d[:, 1] - o[1] * d[:, 0]) / det
    return np.where((t > 0) & (share >= 0) & (share <= 1), t, np.inf)


def shaded(rays, eye, walls, rng):
    """Each wall has its grey; below the floor line there is floor."""
    flat = np.hypot(rays[:, 0], rays[:, 1])
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    each = np.array([meets(azimuth, np.array(p), np.array(q), eye[:2]) for p, q in walls])
    nearest, which = each.min(axis=0), each.argmin(axis=0)
    greys = np.array([200, 150, 120, 90, 60, 230])[which]
    z = eye[2] + rays[:, 2] / flat * nearest
    grey = np.where(z < -HEIGHT_M, 30, greys).reshape(480, 640)
    return np.clip(
        cv2.GaussianBlur(grey.astype(np.float32), (0, 0), 0.8) + rng.normal(0, 2, grey.shape), 0, 255
    ).astype(np.uint8)


@pytest.fixture(scope="module")
def corridors():
    return [corridor(seed) for seed in range(8)]


def line_gate(corridors, place):
    return lines_gate(
        "vertical edges",
        [vertical_offsets(CAMERA, place, grey, scan) for scan, grey in corridors],
        CAMERA,
        sees="yaw, left",
    )


def test_edges_of_a_scan_are_its_jumps_and_corners(corridors):
    scan, _ = corridors[0]
    edges = scan[edges_of_scan(scan)]
    # the ends of the pillar that are seen, and both corners of the room
    assert ((edges[:, 0] > 2.1) & (edges[:, 0] < 2.55)).sum() >= 2
    assert (edges[:, 0] > 3.3).sum() >= 2


def test_vertical_edges_agree_with_the_truth_for_the_axes_they_see(corridors):
    found = line_gate(corridors, T)
    assert found.verdict == "PASS"
    assert "seen: yaw, left" in found.name
    # pitch is not theirs to see
    assert line_gate(corridors, moved(T, 1, np.radians(1.0))).verdict == "PASS"


@pytest.mark.parametrize("turn_deg", [1.5, -1.5])
def test_vertical_edges_contradict_a_wrong_yaw_by_its_pixels(corridors, turn_deg):
    found = line_gate(corridors, moved(T, 2, np.radians(turn_deg)))
    assert found.verdict == "FAIL"
    assert found.value == pytest.approx(400 * np.tan(np.radians(1.5)), abs=2.5)


def test_the_floor_line_sees_pitch(corridors):
    def gate(place):
        found = [floor_offsets(CAMERA, place, grey, scan, height_m=HEIGHT_M) for scan, grey in corridors]
        return lines_gate("floor line", found, CAMERA, sees="pitch, height")

    assert gate(T).verdict == "PASS"
    wrong = gate(moved(T, 1, np.radians(1.5)))
    assert wrong.verdict == "FAIL"
    assert wrong.value == pytest.approx(400 * np.tan(np.radians(1.5)), abs=3)


def test_lines_cannot_tell_in_front_of_a_blank_wall(corridors):
    blank = [(scan, np.full((480, 640), 128, np.uint8)) for scan, _ in corridors]
    found = line_gate(blank, T)
    assert found.verdict == "CANNOT TELL"
    assert "lines stand out" in found.reason
