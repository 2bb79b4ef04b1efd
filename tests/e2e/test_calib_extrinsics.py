"""The installed command on a log drawn here: a board before a robot with a known mounting and clocks that differ."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from wallkit.calib.boards import Board
from wallkit.calib.rigid import angle_between
from wallkit.calib.store import read_calibration
from wallkit.calib.worlds import UPRIGHT, board_at
from wallkit.core.types import CameraImage, CameraInfo, Scan
from wallkit.logs.writer import McapWriter

BOARD = Board("chessboard", 8, 6, 0.07, plate_m=(0.8, 0.6))
K = np.array([[520.0, 0, 320], [0, 520, 240], [0, 0, 1]])
T = np.eye(4)
T[:3, :3], T[:3, 3] = UPRIGHT, (0.03, 0.06, -0.05)
STILL_S, MOVE_S = 1.6, 1.4
TAU_S = 0.030
START_NS = 1_700_000_000_000_000_000


def middle_first(pose):
    """T_camera_board of a board whose middle is at the pose's origin."""
    shift = np.eye(4)
    shift[:2, 3] = -BOARD.plate_corners[:, :2].mean(axis=0)
    return pose @ shift


@pytest.fixture(scope="module")
def stations():
    rng = np.random.default_rng(3)
    return [
        (rng.uniform(-0.25, 0.25), 0.08, rng.uniform(1.1, 1.8), *rng.uniform(-32, 32, 2), rng.uniform(-25, 25))
        for _ in range(14)
    ]


def pose_at(stations, seconds):
    """The board stands at each station, and glides to the next."""
    period = STILL_S + MOVE_S
    i = min(int(seconds / period), len(stations) - 1)
    share = np.clip((seconds - i * period - STILL_S) / MOVE_S, 0, 1)
    following = stations[min(i + 1, len(stations) - 1)]
    smooth = share * share * (3 - 2 * share)
    x, y, z, pitch, yaw, roll = (1 - smooth) * np.array(stations[i]) + smooth * np.array(following)
    return middle_first(board_at(x, y, z, pitch_deg=pitch, yaw_deg=yaw, roll_deg=roll))


def picture(pose, rng):
    """The board as a pinhole sees it, with a little blur and noise."""
    side = 40
    cells = (np.indices((BOARD.rows + 1, BOARD.columns + 1)).sum(axis=0) % 2) * 255
    pattern = np.kron(cells, np.ones((side, side))).astype(np.uint8)
    px = side / BOARD.square_m
    corners = np.round((BOARD.plate_corners[[0, 2], :2] + BOARD.square_m) * px).astype(int)
    border = (-corners[0, 1], corners[1, 1] - pattern.shape[0], -corners[0, 0], corners[1, 0] - pattern.shape[1])
    sheet = cv2.copyMakeBorder(pattern, *(int(b) for b in border), cv2.BORDER_CONSTANT, value=255)
    to_metres = np.array(
        [
            [1 / px, 0, (corners[0, 0] + 0.5) / px - BOARD.square_m],
            [0, 1 / px, (corners[0, 1] + 0.5) / px - BOARD.square_m],
            [0, 0, 1],
        ]
    )
    H = K @ pose[:3, [0, 1, 3]] @ to_metres
    big = cv2.warpPerspective(
        sheet,
        np.diag([2, 2, 1]) @ H,
        (1280, 960),
        flags=cv2.INTER_AREA,
        borderValue=110,
        borderMode=cv2.BORDER_CONSTANT,
    )
    grey = cv2.resize(cv2.GaussianBlur(big, (0, 0), 1.2), (640, 480), interpolation=cv2.INTER_AREA)
    return np.clip(grey + rng.normal(0, 2, grey.shape), 0, 255).astype(np.uint8)


def scan_of(pose, stamp_ns, rng):
    azimuth = np.linspace(-np.pi, np.pi, 720, endpoint=False)
    c, s = np.cos(azimuth), np.sin(azimuth)
    ranges = np.minimum(np.where(c > 0, 4.0, 2.0) / np.maximum(np.abs(c), 1e-9), 2.5 / np.maximum(np.abs(s), 1e-9))
    L = np.linalg.inv(T) @ pose
    beams = np.column_stack([c, s, np.zeros_like(c)])
    along = (L[:3, 2] @ L[:3, 3]) / (beams @ L[:3, 2])
    on = (beams * along[:, None] - L[:3, 3]) @ L[:3, :2]
    low, high = BOARD.plate_corners[0, :2], BOARD.plate_corners[2, :2]
    met = (along > 0.1) & (on > low).all(axis=1) & (on < high).all(axis=1)
    ranges = np.where(met, np.minimum(along, ranges), ranges) + rng.normal(0, 0.008, 720)
    return Scan(stamp_ns, "laser", ranges.astype(np.float32), azimuth.astype(np.float32), 0.0, 0.1, 12.0)


@pytest.fixture(scope="module")
def log(tmp_path_factory, stations):
    path = tmp_path_factory.mktemp("calib") / "log.mcap"
    rng = np.random.default_rng(0)
    seconds = len(stations) * (STILL_S + MOVE_S) - MOVE_S
    with McapWriter(path) as writer:
        info = CameraInfo(
            START_NS, "cam_optical", 640, 480, "plumb_bob", np.zeros(5), K, np.eye(3), np.hstack([K, np.zeros((3, 1))])
        )
        writer.write("/cam/camera_info", info, START_NS)
        for t in np.arange(0, seconds, 0.1):
            true_ns = START_NS + round(t * 1e9)
            pose = pose_at(stations, t)
            _, png = cv2.imencode(".png", picture(pose, rng), [cv2.IMWRITE_PNG_COMPRESSION, 1])
            image = CameraImage(true_ns + round(TAU_S * 1e9), "cam_optical", "png", png.tobytes())
            writer.write("/cam/image/compressed", image, true_ns)
            writer.write("/scan", scan_of(pose, true_ns, rng), true_ns)
    return path


def test_a_log_is_calibrated(wallkit, log, tmp_path):
    (tmp_path / "board.toml").write_text(BOARD.toml())
    words = ("--board", "board.toml", "--sigma-range", "8mm")
    done = wallkit("calib", "extrinsics", log, *words, "-o", "out.toml", "--json", "-q")
    assert done.code == 0, done.err
    found = done.json
    assert found["kind"] == "full"
    assert len(found["views"]) == 14
    stored = read_calibration(tmp_path / "out.toml")
    assert np.degrees(angle_between(stored.T_camera_lidar, T)) < 0.6
    assert np.linalg.norm(stored.T_camera_lidar[:3, 3] - T[:3, 3]) < 0.02
    assert stored.lidar_frame == "laser"
    assert stored.pixel_error_95_at(3.0) < 20
    clock = found["time_offset"]
    assert clock["verdict"] == "known"
    assert clock["tau_s"] == pytest.approx(TAU_S, abs=0.006)
    assert stored.time_offset_ns == pytest.approx(TAU_S * 1e9, abs=6e6)
    assert stored.provenance.inputs.keys() == {"log.mcap"}


def test_the_page_says_what_a_user_needs(wallkit, log, tmp_path):
    (tmp_path / "board.toml").write_text(BOARD.toml())
    done = wallkit("calib", "extrinsics", log, "--board", "board.toml")
    assert done.code == 0, done.err
    for words in (
        "T_camera_lidar",
        "roll",
        "height",
        "at 3 m a LiDAR point lands within",
        "next      hold the board",
        "clocks",
    ):
        assert words in done.out
    assert "20 mm is assumed" in done.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--board", "chessboard:9x7:0.07"), "is in none of"),
        (("--board", "chessboard:8x6:0.07", "--hold"), "--hold needs a transform"),
        (("--board", "chessboard:8x6:0.07", "--sigma-range", "vlp-61"), "did you mean 'vlp-16'"),
        (("--board", "chessboard:8x6:0.07", "--scan", "/points"), "no topic '/points'"),
    ],
)
def test_mistakes_have_one_clear_message_and_leave_no_file(wallkit, log, tmp_path, words, said):
    done = wallkit("calib", "extrinsics", log, *words, "-o", "out.toml", "-q")
    assert done.code == 2
    assert said in done.err
    assert "Traceback" not in done.err
    assert not (tmp_path / "out.toml").exists()


def test_pictures_of_another_size_and_an_empty_scan(wallkit, tmp_path):
    (tmp_path / "pictures").mkdir()
    (tmp_path / "scans").mkdir()
    cv2.imwrite(str(tmp_path / "pictures" / "1.png"), np.zeros((240, 320), np.uint8))
    (tmp_path / "scans" / "1.csv").write_text("x,y\n0,0\n0,0\n")
    (tmp_path / "camera.yaml").write_text(
        "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
        "camera_matrix: {rows: 3, cols: 3, data: [520, 0, 320, 0, 520, 240, 0, 0, 1]}\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
    )
    words = (
        "extrinsics",
        "pictures",
        "--scans",
        "scans",
        "--camera",
        "camera.yaml",
        "--board",
        "chessboard:8x6:0.07",
        "-q",
    )
    done = wallkit("calib", *words)
    assert done.code == 2
    assert "320 x 240 px, the calibration is for 640 x 480" in done.err
    pose = middle_first(board_at(0, 0, 1.2, pitch_deg=20, yaw_deg=20))
    cv2.imwrite(str(tmp_path / "pictures" / "1.png"), picture(pose, np.random.default_rng(0)))
    done = wallkit("calib", *words)
    assert done.code == 2
    assert "the scan is empty" in done.err
