"""`wallkit ceiling fit | build`: what they find is what was drawn."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.e2e.ceiling_log import corridor_ceiling, write_log
from wallkit.core.ceiling import CeilingMap
from wallkit.maps.ceiling.files import read_ceiling


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    at = tmp_path_factory.mktemp("ceiling")
    write_log(at, with_lidar=False)
    # a photograph from below: mirrored, turned by 20 degrees, of a scale of its own
    picture = cv2.imread(str(at / "ceiling.png"))[:, ::-1]
    height, width = picture.shape[:2]
    M = cv2.getRotationMatrix2D((width / 2, height / 2), 20, 1.3)
    M[:, 2] += (250, 350)
    cv2.imwrite(
        str(at / "photo.png"), cv2.warpAffine(picture, M, (width + 500, height + 700), borderValue=(90, 90, 90))
    )
    return at


def colours_on_the_way(ceiling: CeilingMap) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(2, 12, 0.1), np.arange(0.6, 1.8, 0.1))
    cells, seen = ceiling.cells_at(np.stack([x, y], axis=-1))
    return ceiling.pixels[cells[..., 0], cells[..., 1]].astype(float), seen


def test_fit_scales_a_photograph_by_odometry_and_says_how_well(wallkit, folder, tmp_path):
    found = wallkit(
        "ceiling", "fit", folder / "log.mcap", "--picture", folder / "photo.png", "-o", "c.yaml", "--json"
    ).json
    truth = 0.02 / 1.3
    assert found["is_mirrored"]
    assert abs(found["resolution_m"] / truth - 1) < 0.01
    assert abs(found["resolution_m"] - truth) < 4 * found["resolution_sigma_m"]
    assert 0 < found["resolution_sigma_m"] / truth < 0.01
    assert found["height_m"] == pytest.approx(2.7, abs=0.05)
    assert read_ceiling(tmp_path / "c.yaml").resolution_m == pytest.approx(found["resolution_m"], rel=1e-6)


@pytest.mark.long
def test_with_poses_the_photograph_lies_where_the_ceiling_is(wallkit, folder, tmp_path):
    words = (
        "ceiling",
        "fit",
        folder / "log.mcap",
        "--picture",
        folder / "photo.png",
        "--poses",
        "truth",
        "-o",
        "c.yaml",
    )
    done = wallkit(*words)
    assert done.code == 0, done.err
    assert "which is mirrored" in done.out
    drawn, _ = colours_on_the_way(corridor_ceiling())
    fitted, seen = colours_on_the_way(read_ceiling(tmp_path / "c.yaml"))
    assert seen.all()
    assert np.median(np.abs(drawn - fitted)) < 6
    assert wallkit(*words).code == 2


@pytest.mark.long
def test_build_stitches_what_was_drawn_and_finds_its_height(wallkit, folder, tmp_path):
    found = wallkit("ceiling", "build", folder / "log.mcap", "-o", "c.yaml", "--json", "-q").json
    assert found["height_m"] == pytest.approx(2.7, abs=0.03)
    drawn, _ = colours_on_the_way(corridor_ceiling())
    built, seen = colours_on_the_way(read_ceiling(tmp_path / "c.yaml"))
    assert seen.mean() > 0.97
    assert np.median(np.abs(drawn - built)[seen]) < 8


def test_what_cannot_be_fitted_is_said(wallkit, folder, tmp_path):
    cv2.imwrite(str(tmp_path / "blank.png"), np.full((300, 400, 3), 200, np.uint8))
    done = wallkit("ceiling", "fit", folder / "log.mcap", "--picture", "blank.png")
    assert done.code == 2
    assert "0 of" in done.err
    assert "--matches" in done.err
    (tmp_path / "clicked.csv").write_text("stamp_s,u_px,v_px\n1,x,3\n")
    done = wallkit("ceiling", "fit", folder / "log.mcap", "--picture", "blank.png", "--matches", "clicked.csv")
    assert "clicked.csv:2:" in done.err


def test_clicked_places_are_enough(wallkit, folder, tmp_path):
    """Every pixel is the place straight above the camera, read off the drawing."""
    rows = [line.split() for line in (folder / "truth.tum").read_text().splitlines() if not line.startswith("#")]
    picked = rows[10::40]
    start = float(rows[1][0]) + 0.017
    lines = ["stamp_s,u_px,v_px"]
    for row in picked:
        x, y, yaw = float(row[1]), float(row[2]), 2 * np.arctan2(float(row[6]), float(row[7]))
        at = (
            np.array([x, y]) + 0.1 * np.array([np.cos(yaw), np.sin(yaw)]) - 0.05 * np.array([-np.sin(yaw), np.cos(yaw)])
        )
        lines.append(f"{float(row[0]) - start:.3f},{(at[0] + 0.5) / 0.02:.1f},{220 - (at[1] + 1.0) / 0.02:.1f}")
    (tmp_path / "clicked.csv").write_text("\n".join(lines) + "\n")
    found = wallkit(
        "ceiling", "fit", folder / "log.mcap", "--picture", folder / "ceiling.png", "--matches", "clicked.csv", "--json"
    ).json
    assert found["resolution_m"] == pytest.approx(0.02, rel=0.05)
    assert found["height_m"] is None
