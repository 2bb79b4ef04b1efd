"""A result folder -> one PNG: the map figure of its report, rendered by a headless Chromium.

The README's picture is made by

    wallkit demo && python docs/picture.py wallkit-demo/class_conditional/seed-0 docs/pictures/demo.png
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from wallkit.pipelines.config import load_config
from wallkit.pipelines.evaluate import evaluate_steps
from wallkit.pipelines.report import report_data
from wallkit.pipelines.run_folder import read_run
from wallkit.report.figures import draw_figures


def main(run: Path, out: Path) -> None:
    """Draw the figures of the run again, and take the first: where the robot was."""
    settings = load_config(None).config.evaluate
    record = read_run(run)
    picture, *_ = draw_figures(report_data(record, evaluate_steps(record.steps, record.truth, settings), settings))
    with tempfile.TemporaryDirectory() as folder:
        svg = Path(folder) / "map.svg"
        svg.write_bytes(picture.svg)
        width, height = size_of(picture.svg.decode())
        flags = ["--headless", "--no-sandbox", "--hide-scrollbars", f"--window-size={width},{height}"]
        subprocess.run(["chromium", *flags, f"--screenshot={out.resolve()}", svg.as_uri()], check=True)


def size_of(svg: str) -> tuple[int, int]:
    """Width and height in CSS pixels, of which 96 are 72 points."""
    found = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', svg)
    assert found, "matplotlib writes the size in points"
    return round(float(found[1]) * 96 / 72), round(float(found[2]) * 96 / 72)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
