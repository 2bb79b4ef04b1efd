"""`wallkit report RUN --animate`."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

import wallkit.sample

SAMPLE = Path(wallkit.sample.__file__).parent


def test_a_run_becomes_a_gif_over_its_map(wallkit, tmp_path):
    log = (SAMPLE / "log.mcap", "--map", SAMPLE / "map.yaml", "--init", "global", "--end", "15", "-q")
    wallkit("localize", *log, "-o", "run")
    done = wallkit("report", "run", "--animate", "cloud.gif")
    assert done.code == 0, done.err
    with Image.open(tmp_path / "cloud.gif") as image:
        assert image.n_frames > 3
    assert wallkit("report", "run", "--animate", "cloud.gif", "-o", "page.html").code == 2
