"""The sample inside the package -> map and calibration judged, localized with every filter, compared with what is expected.

The same steps a user takes: `map validate`, `calib verify`, `localize --filter`, `compare`.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import wallkit.sample
from wallkit.calib.verify.gates import Gate
from wallkit.core.calibration import Calibration
from wallkit.core.results import Value
from wallkit.maps.findings.judged import Judged
from wallkit.pipelines.calib.verify import VerifyRequest, verify_calibration
from wallkit.pipelines.cameras import ORACLE_MODEL, CameraRequest
from wallkit.pipelines.config import default_config
from wallkit.pipelines.evaluate import Evaluation
from wallkit.pipelines.localize import Request, prepare
from wallkit.pipelines.map.verdicts import Selection, judge
from wallkit.pipelines.report import compare_runs
from wallkit.pipelines.run_folder import RunRecord, read_json, write_json
from wallkit.pipelines.seeds import run_seed, write_seeds
from wallkit.pipelines.shared import Shared
from wallkit.report.compare import CompareData
from wallkit.report.demo import DemoData, demo_html
from wallkit.report.html import write_page
from wallkit.segment.default import DEFAULT

SAMPLE = Path(wallkit.sample.__file__).parent
LOG, MAP, CALIBRATION = SAMPLE / "log.mcap", SAMPLE / "floor.wkmap.urdf", SAMPLE / "camera.toml"
# a start of its own each, for the spread over runs; the first has the pictures and the report
SEEDS = 3
FIRST = "seed-0"
# after the robot was found: until then the error is metres, and says more about the first guess than about the method
COMPARED = ("ate_median_m", "updates_to_converge")
# of a class with fewer returns in a run, the share says little
_ENOUGH = 200

Seeds = Sequence[tuple[RunRecord, Evaluation]]


@dataclass(frozen=True)
class Method:
    """A way to treat people.

    Attributes:
        words: settings. model: what calls the pixels of its images wall or person; "" without a camera.
    """

    words: tuple[str, ...]
    model: str = ""


# the paper's method: its pictures stand on the page
FILTERED = "wall_mask"
_FIELD = "localize.sensor=likelihood_field"

# first without any idea of people, then by the LiDAR alone, then with the camera
METHODS: dict[str, Method] = {
    "basic": Method((_FIELD,)),
    "class_conditional": Method(("localize.sensor=class_conditional",)),
    "novelty": Method((_FIELD, 'points.filters=["novelty"]')),
    FILTERED: Method((_FIELD, 'points.filters=["wall_mask"]'), DEFAULT),
    "wall_mask, true masks": Method((_FIELD, 'points.filters=["wall_mask"]'), ORACLE_MODEL),
    "soft_mask": Method((_FIELD, 'points.filters=["soft_mask"]'), DEFAULT),
}


@dataclass(frozen=True)
class Demo:
    """What the demo found.

    Attributes:
        map: judged. calibration: with the verdict that boards gave it. room: what the walls in the log say about it.
        runs: seeds by method. data: the methods side by side.
        surprises: every answer that is not as expected, in words.
    """

    map: Judged
    calibration: Calibration
    room: tuple[Gate, ...]
    runs: dict[str, Seeds]
    data: CompareData
    surprises: tuple[str, ...] = ()


def run_demo(out: Path, observe: Callable[[str], None] = lambda doing: None) -> Demo:
    """Judge the sample's map and calibration, localize it with every method, and write each run and the comparison."""
    observe("validating the map")
    config = default_config().config
    (judged,) = judge([MAP], Selection(config.rules, datetime.date.today()))
    observe("verifying the calibration")
    verified = verify_calibration(VerifyRequest((LOG,), CALIBRATION))
    shared, runs = Shared(), {}
    for name, method in METHODS.items():
        observe(f"localizing: {name}")
        runs[name] = _localized(method, out / folder_of(name), shared)
    data = compare_runs(list(runs.values()), list(runs), config.evaluate, seed=0, keys=COMPARED)
    (first, _), *_ = runs["basic"]
    methods = {name: {"settings": list(m.words), "model": m.model} for name, m in METHODS.items()}
    told = {"schema": 2, "command": "demo", "wallkit": first.run["wallkit"], "seeds": SEEDS, "methods": methods}
    write_json(out / "run.json", told)
    found = Demo(judged, verified.calibration, verified.evidence.target_free, runs, data)
    write_page(out / "report.html", demo_html(_page(found)))
    return found


def answers(found: Demo) -> tuple[tuple[str, str], ...]:
    """(what, the answer) in words: the map, the calibration, and what the table says."""
    nearest, sure = conclusion(found)
    room = "; ".join(f"{gate.verdict}: {gate.reason or gate.wanted}" for gate in found.room)
    return (
        ("map", f"{map_answer(found.map)}, {found.map.report.count('info')} infos"),
        ("calibration", f"{found.calibration.verdict} by boards, as stored in it"),
        ("by this log", room),
        ("nearest", nearest),
        ("is it sure?", sure),
    )


def _page(found: Demo) -> DemoData:
    nearest, sure = conclusion(found)
    verdict = f"Nearest is {nearest}. Is it sure? {sure[0].upper()}{sure[1:]}."
    compared = replace(found.data, title="A robot among six people", verdict=verdict)
    (record, _), *_ = found.runs[FILTERED]
    pages = tuple((name, f"{folder_of(name)}/{FIRST}/report.html") for name in found.runs)
    return DemoData(answers(found)[:3], compared, record.photos, pages)


def conclusion(found: Demo) -> tuple[str, str]:
    """Which method was nearest to the truth, and whether one can be told from the first: a sentence each."""
    means = {c.name: c.spreads["ate_median_m"].mean for c in found.data.contenders}
    errors = {name: mean for name, mean in means.items() if mean is not None}
    best, (first, *_) = min(errors, key=lambda name: errors[name]), errors
    nearest = f"{best}: median error {100 * errors[best]:.2f} cm; {first}: {100 * errors[first]:.2f} cm"
    tests = [(b, c) for _, b, c in found.data.differences if c.key == "ate_median_m"]
    words = {"a": "worse", "b": "better"}
    told = [f"{b} is {words[c.better]} (p = {c.p_value:.2g})" for b, c in tests if c.better in words]
    if told:
        return nearest, f"against {first} on this log: {', '.join(told)}"
    least = min(c.p_value for _, c in tests)
    return nearest, f"no: {SEEDS} seeds of one log tell none from {first} (p = {least:.2g} at least)"


def folder_of(method: str) -> str:
    """The name of a method's folder in the results."""
    return method.replace(", ", "_").replace(" ", "_")


def _localized(method: Method, folder: Path, shared: Shared) -> Seeds:
    """Every seed, in folders like those of `localize --seeds`; the first with its report and pictures."""
    loaded = default_config(method.words)
    cameras = CameraRequest((CALIBRATION,), model=method.model) if method.model else CameraRequest()
    request = Request((LOG,), MAP, init="global", cameras=cameras)
    prepared = prepare(request, loaded.config, seeds=SEEDS, shared=shared)
    (folder / FIRST).mkdir(parents=True)
    found = [run_seed(prepared, loaded, folder / FIRST)]
    found += [run_seed(prepared, loaded, folder / f"seed-{seed}", seed=seed) for seed in range(1, SEEDS)]
    records = [(record, evaluation) for _, record, evaluation in found]
    write_seeds(folder, records)
    return records


# ------------------------------------------------------------------------------------------------ is it as expected?


def expected_answers() -> dict[str, Any]:
    """expected.json of the sample."""
    return read_json(SAMPLE / "expected.json")


def surprises(found: Demo, expected: dict[str, Any]) -> tuple[str, ...]:
    """Answers that differ from what expected.json says, and numbers outside the ranges it gives them."""
    answers = {"map": map_answer(found.map), "calibration": found.calibration.verdict}
    said = [f"{key}: is {is_}, expected {expected[key]}" for key, is_ in answers.items() if is_ != expected[key]]
    said += [f"calibration: the room contradicts it: {gate.reason}" for gate in found.room if gate.verdict == "FAIL"]
    for name, ranges in expected["methods"].items():
        for record, evaluation in found.runs[name]:
            where = f"{name}, seed {record.run['seed']}"
            if record.answer["health"] != expected["health"]:
                said.append(f"{where}: ends {record.answer['health']}, expected {expected['health']}")
            said += _outside(where, numbers_of(record, evaluation), ranges)
    return tuple(said)


def numbers_of(record: RunRecord, evaluation: Evaluation) -> dict[str, Value]:
    """What expected.json has ranges for: metrics, resources, and of each class how much of its returns was kept.

    The share that is kept of all returns tells little: a filter that drops walls and keeps people may have the same.
    """
    classes = record.run.get("filtering", {}).get("classes", {})
    kept = {
        f"kept_share of {name}": Value(f"kept_share of {name}", of["kept"] / of["returns"], "share", "")
        for name, of in classes.items()
        if of["returns"] >= _ENOUGH
    }
    return {**evaluation.metrics, **record.resources, **kept}


def map_answer(judged: Judged) -> str:
    """Of the map: good or not, with its counts."""
    verdict = "good" if judged.is_good else "NOT good"
    return f"{verdict}: {judged.report.count('error')} errors, {judged.report.count('warning')} warnings"


def _outside(where: str, values: dict[str, Value], ranges: dict[str, list[float]]) -> list[str]:
    found = []
    for key, (low, high) in ranges.items():
        value = values.get(key, Value(key, None, "", "")).value
        if value is None or not low <= value <= high:
            found.append(f"{where}: {key} is {value}, expected {low} to {high}")
    return found
