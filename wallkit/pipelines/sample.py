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
from wallkit.pipelines.demo import SAMPLE, run_demo
from wallkit.pipelines.evaluate import Evaluation
from wallkit.pipelines.map.export import plan_export, write_export
from wallkit.pipelines.run_folder import RunRecord, write_json
from wallkit.pipelines.sample_camera import write_calibration
from wallkit.pipelines.simulate.log import LogRequest, simulate_log
from wallkit.simulate.scenario import read_scenario

SEED = 20
# how much worse than here another machine may find it
_SLACK = 2.0
_STEP_M, _STEP_DEG, _LESS_AVAILABLE = 0.005, 0.1, 0.05


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
        write_json(folder / "expected.json", expected(run_demo(Path(scratch) / "demo").runs))


def expected(runs: dict[str, tuple[RunRecord, Evaluation]]) -> dict[str, Any]:
    """expected.json: what the methods must end with, and the range for each of their numbers, some slack given."""
    (health,) = {record.answer["health"] for record, _ in runs.values()}
    return {"health": health, "methods": {name: _ranges(evaluation.metrics) for name, (_, evaluation) in runs.items()}}


def _ranges(metrics: dict[str, Value]) -> dict[str, list[float]]:
    found = {key: value.value for key, value in metrics.items() if value.value is not None}
    return {
        "ate_median_m": [0, _up(found["ate_median_m"], _STEP_M)],
        "heading_error_median_deg": [0, _up(found["heading_error_median_deg"], _STEP_DEG)],
        "updates_to_converge": [1, _up(found["updates_to_converge"], 1)],
        "false_healthy": [0, 0],
        "availability": [round(found["availability"] - _LESS_AVAILABLE, 2), 1],
    }


def _up(value: float, step: float) -> float:
    return round(math.ceil(_SLACK * value / step) * step, 3)


if __name__ == "__main__":
    write_sample()
