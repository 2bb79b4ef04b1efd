"""Result folders drawn for the tests: an ellipse driven with a known error, as `localize` would leave it."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.report.worlds import round_trip, steps
from wallkit.core.config import table_from
from wallkit.pipelines.config import Config
from wallkit.pipelines.evaluate import EvaluateSettings, evaluate_steps
from wallkit.pipelines.run_folder import RunRecord, write_run

LOG = "logs/hall.mcap"


def record(error_m, *, seed=0, log=LOG, digest="a" * 64, truth=True):
    """A run that is `error_m` off at every scan; `digest` is of the log's bytes, None: run.json does not have it."""
    drawn = steps(healthy=True)
    offset = np.column_stack([np.full(len(drawn), error_m), np.zeros((len(drawn), 2))])
    inputs = [{"path": log, "bytes": 1, **({"sha256": digest} if digest else {})}]
    inputs.append({"path": "floor.yaml", "bytes": 1, "sha256": "f" * 64})
    run = {
        "schema": 1, "wallkit": "0", "argv": [], "seed": seed, "logs": [log], "map": "floor.yaml", "inputs": inputs,
        "dropped": {}, "lost": [], "notes": [], "seconds": {}, "machine": {}, "config": table_from(Config()),
        "origins": {}, "config_file": None, "start": "global", "scan": "/scan", "odometry": "/odom", "lidar_mount": "given",
        "ceiling": None,
    }  # fmt: skip
    moved, known = replace(drawn, poses=round_trip().poses + offset), round_trip() if truth else None
    numbers = evaluate_steps(moved, known, EvaluateSettings()).metrics
    answer = {
        "health": "LOCALIZED",
        "reason": "",
        "modes": [{}],
        "seed": seed,
        **{k: v.value for k, v in numbers.items()},
    }
    return RunRecord(Path(log).name, moved, answer, run, None, known, None, ())


def judged(error_m, **options):
    """The run and what it is worth."""
    made = record(error_m, **options)
    return made, evaluate_steps(made.steps, made.truth, EvaluateSettings())


def write_folder(folder, error_m, **options):
    """The run as a result folder."""
    folder.mkdir(parents=True)
    write_run(folder, record(error_m, **options))
    return folder
