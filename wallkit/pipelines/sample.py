"""The sample inside the package: its map and its scenario -> log, truth, raster, calibration, and what the demo must find.

`make sample` writes it anew; it needs MuJoCo and OpenGL. Reading it needs neither.
"""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path
from typing import Any

from wallkit.core.results import Value
from wallkit.maps.exporters import ExportOptions
from wallkit.pipelines.demo import SAMPLE, Demo, map_answer, numbers_of, run_demo
from wallkit.pipelines.map.export import plan_export, write_export
from wallkit.pipelines.run_folder import write_json
from wallkit.pipelines.sample_camera import write_calibration
from wallkit.pipelines.simulate.log import LogRequest, simulate_log
from wallkit.simulate.scenario import read_scenario

SEED = 20
# how much worse than here another machine may find it
_SLACK = 2.0
_STEP_M, _STEP_DEG, _LESS_AVAILABLE, _SHARE, _SHARE_OF_CLASS = 0.002, 0.05, 0.05, 0.005, 0.03


def write_sample(folder: Path = SAMPLE) -> None:
    """Everything that `floor.wkmap.urdf` and `scenario.toml` in the folder lead to, written beside them.

    Raises:
        SimulationError: no OpenGL works.
    """
    chart = folder / "floor.wkmap.urdf"
    scenario = read_scenario(folder / "scenario.toml")
    with tempfile.TemporaryDirectory() as scratch:
        simulate_log(LogRequest(chart, scenario, seed=SEED), Path(scratch) / "log")
        for name in ("log.mcap", "truth.tum", "manifest.json"):
            shutil.copyfile(Path(scratch) / "log" / name, folder / name)
        write_calibration(folder / "camera.toml", scenario, Path(scratch))
        # a map_server file of it, for those who have only that
        write_export(plan_export(chart, folder / "map.yaml", ExportOptions(), overwrite=True))
        write_json(folder / "expected.json", expected(run_demo(Path(scratch) / "demo")))


def expected(found: Demo) -> dict[str, Any]:
    """expected.json: what the demo must answer, and the range for each number of each method, some slack given."""
    (health,) = {record.answer["health"] for seeds in found.runs.values() for record, _ in seeds}
    methods = {
        name: _ranges([numbers_of(record, evaluation) for record, evaluation in seeds])
        for name, seeds in found.runs.items()
    }
    return {
        "health": health,
        "map": map_answer(found.map),
        "calibration": found.calibration.verdict,
        "methods": methods,
    }


def _ranges(runs: list[dict[str, Value]]) -> dict[str, list[float]]:
    """By metric, around what all seeds have."""

    def over(key: str) -> list[float]:
        return [v.value for run in runs if (v := run.get(key)) is not None and v.value is not None]

    found: dict[str, list[float]] = {
        "ate_median_m": [0, _up(max(over("ate_median_m")), _STEP_M)],
        "heading_error_median_deg": [0, _up(max(over("heading_error_median_deg")), _STEP_DEG)],
        "updates_to_converge": [1, _up(max(over("updates_to_converge")), 1)],
        "false_healthy": [0, 0],
        "availability": [round(min(over("availability")) - _LESS_AVAILABLE, 2), 1],
    }
    # a filter that keeps everything, or next to nothing, is broken however small the error
    kept = dict.fromkeys(key for run in runs for key in run if key.startswith("kept_share"))
    for key in (*kept, "unseen_share"):
        if len(shares := over(key)) == len(runs):
            slack = _SHARE_OF_CLASS if key.startswith("kept_share of") else _SHARE
            found[key] = [round(max(min(shares) - slack, 0), 3), round(min(max(shares) + slack, 1), 3)]
    return found


def _up(value: float, step: float) -> float:
    return round(math.ceil(_SLACK * value / step) * step, 3)


if __name__ == "__main__":
    write_sample()
