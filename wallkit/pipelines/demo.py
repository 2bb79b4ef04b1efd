"""The sample inside the package -> the main job, basic against filtered, and whether it came out as expected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import wallkit.sample
from wallkit.core.results import Value
from wallkit.pipelines.config import load_config
from wallkit.pipelines.evaluate import Evaluation
from wallkit.pipelines.localize import Request, prepare
from wallkit.pipelines.report import compare_runs, write_compare_report
from wallkit.pipelines.run_folder import RunRecord, read_json, write_json
from wallkit.pipelines.seeds import run_seed
from wallkit.pipelines.shared import Shared

SAMPLE = Path(wallkit.sample.__file__).parent

# one method, LiDAR only: first without any idea of people, then with two that have one
METHODS: dict[str, tuple[str, ...]] = {
    "basic": ("localize.sensor=likelihood_field",),
    "novelty": ("localize.sensor=likelihood_field", 'points.filters=["novelty"]'),
    "class_conditional": ("localize.sensor=class_conditional",),
}


@dataclass(frozen=True)
class Demo:
    """What the demo found: the runs by method, and every number that is not as expected, in words."""

    runs: dict[str, tuple[RunRecord, Evaluation]]
    surprises: tuple[str, ...]


def run_demo(out: Path, observe: Callable[[str], None] | None = None) -> Demo:
    """Localize the sample with every method, write each run and the comparison, and compare with expected.json."""
    runs: dict[str, tuple[RunRecord, Evaluation]] = {}
    shared = Shared()
    for name, words in METHODS.items():
        if observe:
            observe(name)
        loaded = load_config(None, words)
        request = Request((SAMPLE / "log.mcap",), SAMPLE / "floor.wkmap.urdf", init="global")
        folder = out / name
        folder.mkdir(parents=True)
        _, record, evaluation = run_seed(prepare(request, loaded.config, shared=shared), loaded, folder)
        runs[name] = (record, evaluation)
    settings = load_config(None).config.evaluate
    data = compare_runs([[pair] for pair in runs.values()], list(runs), settings, seed=0)
    write_compare_report(out / "report.html", data)
    first = next(iter(runs.values()))[0].run
    about = {
        "schema": 1,
        "wallkit": first["wallkit"],
        "methods": {name: list(words) for name, words in METHODS.items()},
    }
    write_json(out / "run.json", about)
    return Demo(runs, tuple(surprises(runs, read_json(SAMPLE / "expected.json"))))


def surprises(runs: dict[str, tuple[RunRecord, Evaluation]], expected: dict[str, Any]) -> list[str]:
    """Numbers outside the range that expected.json gives them."""
    found = []
    for name, ranges in expected["methods"].items():
        record, evaluation = runs[name]
        if record.answer["health"] != expected["health"]:
            found.append(f"{name}: ends {record.answer['health']}, expected {expected['health']}")
        for key, (low, high) in ranges.items():
            value = evaluation.metrics.get(key, Value(key, None, "", "")).value
            if value is None or not low <= value <= high:
                found.append(f"{name}: {key} is {value}, expected {low} to {high}")
    return found
