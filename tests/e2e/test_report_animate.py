"""`wallkit report RUN --animate`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import wallkit.sample
from wallkit.core.types import Trajectory
from wallkit.errors import WallkitError
from wallkit.pipelines.animate import chosen, doubling
from wallkit.report.animate import Ground, film

SAMPLE = Path(wallkit.sample.__file__).parent


def test_a_run_becomes_a_gif_or_a_film_over_its_map(wallkit, tmp_path):
    log = (SAMPLE / "log.mcap", "--map", SAMPLE / "map.yaml", "--init", "global", "--end", "15", "-q")
    wallkit("localize", *log, "-o", "run")
    done = wallkit("report", "run", "--animate", "cloud.gif")
    assert done.code == 0, done.err
    with Image.open(tmp_path / "cloud.gif") as image:
        frames = image.n_frames
    assert f"{frames} moments" in done.out
    updates = sum("nan" not in row.lower() for row in (tmp_path / "run" / "steps.csv").read_text().splitlines()[1:])
    assert 20 < frames <= min(60, updates)
    av = pytest.importorskip("av")
    assert wallkit("report", "run", "--animate", "cloud.mp4").code == 0
    with av.open(str(tmp_path / "cloud.mp4")) as container:
        shown = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(shown) > frames
    assert np.abs(shown[0].astype(int) - shown[-1]).mean() > 0.5
    assert wallkit("report", "run", "--animate", "cloud.png").out.strip() == "animated cloud.png: 6 moments"
    with Image.open(tmp_path / "cloud.png") as sheet:
        width, height = sheet.size
        assert width > 3 * 700
        halves = np.asarray(sheet.convert("L"), dtype=int)
    # the first cloud is wide, the last one is not
    dark = [(part < 30).sum() for part in (halves[: height // 2, : width // 3], halves[height // 2 :, -width // 3 :])]
    assert dark[0] > dark[1]
    refused = wallkit("report", "run", "--animate", "cloud.avi")
    assert (refused.code, ".mp4" in refused.err) == (2, True)
    assert wallkit("report", "run", "--animate", "cloud.gif", "-o", "page.html").code == 2


def test_the_first_moments_are_neighbours_and_the_last_is_shown():
    assert chosen(7, 60).tolist() == list(range(7))
    shown = chosen(1000, 60)
    assert len(shown) == len(set(shown.tolist())) == 60
    assert shown[:16].tolist() == list(range(16))
    assert shown[-1] == 999


def test_on_a_page_moments_are_ever_further_apart():
    assert doubling(4, 6).tolist() == [0, 1, 2, 3]
    shown = doubling(1000, 6)
    assert shown.tolist() == [0, 3, 15, 62, 250, 999]


def test_without_pyav_the_film_says_what_to_install(wallkit, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    ground = Ground(np.full((40, 60, 3), 255, np.uint8), 0.1, np.zeros(3))
    with pytest.raises(WallkitError, match="PyAV") as refusal:
        film(ground, (), Trajectory(np.zeros(1, np.int64), np.zeros((1, 3))), None)
    assert "wallkit[video]" in refusal.value.hint
