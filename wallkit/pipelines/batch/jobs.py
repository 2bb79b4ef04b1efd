"""One run of a batch -> what the command by itself would do: files in a folder, a verdict, an exit code and numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from wallkit.batch.rows import Measure
from wallkit.core.config import Source, build, read_toml
from wallkit.core.types import Health
from wallkit.pipelines.batch.files import path_of
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.pipelines.batch.plan import Task
from wallkit.pipelines.cameras import CameraRequest
from wallkit.pipelines.config import Config, LoadedConfig
from wallkit.pipelines.localize import Prepared, Request, prepare
from wallkit.pipelines.run_folder import write_json
from wallkit.pipelines.shared import Shared

OK, BAD, DATA_LOST, CANNOT_TELL = 0, 1, 3, 4
# of a result folder, what the table and the reports of a batch do without; half a megabyte a run
_LEFT_OUT = ("snapshots.npz", "odometry.tum")


@dataclass(frozen=True)
class Came:
    """What came of a run; see batch.rows.Outcome."""

    verdict: str
    exit_code: int
    metrics: Mapping[str, float | None]
    message: str = ""


@dataclass
class _Warm:
    """What the runs of one log share in this process: the log, and what was prepared for the last configuration."""

    log: tuple[str, ...] = ()
    shared: Shared = field(default_factory=Shared)
    configuration: object = None
    prepared: Prepared | None = None


_warm = _Warm()


def localize_and_evaluate(task: Task, folder: Path) -> Came:
    """`wallkit localize` and `evaluate`, the log opened and unpacked for the first run over it."""
    from wallkit.pipelines.seeds import run_seed

    config, origins = build(Config, [Source(task.table, "manifest")])
    prepared = _prepared(task, config)
    loaded = LoadedConfig(config, origins, None)
    if task.reports:
        folder.mkdir()
        prepared = replace(prepared, request=replace(prepared.request, seed=task.seed))
        run, record, evaluation = run_seed(prepared, loaded, folder)
    else:
        run, record, evaluation = run_seed(prepared, loaded, folder, seed=task.seed)
        for name in _LEFT_OUT:
            (folder / name).unlink(missing_ok=True)
    health = record.answer["health"]
    is_lost = bool(run.loss) or run.sync.share_dropped > 0.01
    code = CANNOT_TELL if health != Health.LOCALIZED.name else DATA_LOST if is_lost else OK
    numbers = {key: value.value for key, value in {**evaluation.metrics, **record.resources}.items()}
    return Came(health, code, numbers, "; ".join(run.loss.lines()) if run.loss else "")


def verify(task: Task, folder: Path) -> Came:
    """`wallkit calib verify`."""
    from wallkit.calib.board.boards import board_from
    from wallkit.pipelines.calib.verify import VerifyRequest, verify_calibration
    from wallkit.pipelines.calib.verify_document import document

    config, _ = build(Config, [Source(task.table, "manifest")])
    words = _beside(task, task.manifest.board)
    found = verify_calibration(
        VerifyRequest(
            inputs=(Path(task.log),),
            calibration=Path(task.calibrations[0]),
            board=board_from(words) if words else None,
            sigma_range=task.manifest.lidar_sigma or None,
            seed=task.seed,
        ),
        limits=config.calib.verify,
        progress=lambda count: None,
    )
    _write(folder, "verify.json", document(found), task)
    numbers = {f"gate_{_key_of(gate.name, gate.unit)}": gate.value for _, gate in found.judgement.gates if gate.verdict}
    verdict = found.judgement.verdict
    return Came(verdict, {"PASS": OK, "FAIL": BAD}.get(verdict, CANNOT_TELL), {**numbers, "pictures": found.looked_at})


def audit(task: Task, folder: Path) -> Came:
    """`wallkit map audit`; ignores of the map count whatever their `until`, so that every day has the same result."""
    from wallkit.maps.findings.formats import DOCUMENTS
    from wallkit.pipelines.map.audit import AuditRequest, check_semantic
    from wallkit.pipelines.map.audit import audit as audit_map

    config, _ = build(Config, [Source(task.table, "manifest")])
    check_semantic(Path(task.map))
    done = audit_map(
        AuditRequest(
            map=Path(task.map),
            logs=(Path(task.log),),
            today=None,
            truth=task.truth or None,
            init=task.manifest.init or None,
            seed=task.seed,
        ),
        config,
    )
    _write(folder, "audit.json", DOCUMENTS["json"]([done.judged]), task)
    evidence, findings = done.evidence, done.judged.report.findings
    numbers = {
        "coverage": evidence.coverage,
        "explained": evidence.explained,
        "scale": 1 + float(evidence.drift.values[3]),
        "places": evidence.places,
        "findings": len(findings),
        "findings_error": sum(finding.severity == "error" for finding in findings),
    }
    if done.cannot_tell:
        return Came("CANNOT TELL", CANNOT_TELL, numbers, done.cannot_tell)
    return Came("AGREES", OK, numbers) if done.judged.is_good else Came("DIFFERS", BAD, numbers)


def simulate(task: Task, folder: Path) -> Came:
    """`wallkit simulate log`: the scenario is what the manifest calls log."""
    from wallkit.pipelines.simulate.log import LogRequest, simulate_log
    from wallkit.simulate.robot import DEFAULT_ROBOT
    from wallkit.simulate.scenario import scenario_from

    scenario = scenario_from([read_toml(Path(task.log)), Source(task.table, "manifest")])
    robot = Path(_beside(task, task.manifest.robot)) if task.manifest.robot else DEFAULT_ROBOT
    done = simulate_log(LogRequest(Path(task.map), scenario, robot, task.seed), folder)
    numbers = {key: value for key, value in asdict(done).items() if isinstance(value, int | float)}
    return Came("", OK, {**numbers, "messages": sum(done.messages.values())})


def measures_of(job: str) -> Iterator[Measure]:
    """What the numbers of a job are."""
    if job == "localize":
        for key, label in labels_of_runs().items():
            is_timing = label.unit in ("ms", "%", "MB") or key == "wall_s"
            yield Measure(key, label.unit, label.definition, label.better, is_timing)
    yield from _MEASURES.get(job, ())


def _prepared(task: Task, config: Config) -> Prepared:
    """Everything found and checked; again for another configuration only, and read again for another log only."""
    if _warm.log != (task.log,):
        _warm.log, _warm.shared, _warm.configuration, _warm.prepared = (task.log,), Shared(), None, None
    asked = (task.map, task.calibrations, task.truth, task.model, task.manifest, config)
    if _warm.prepared is None or _warm.configuration != asked:
        m = task.manifest
        request = Request(
            logs=(Path(task.log),),
            map=Path(task.map) if task.map else None,
            init=m.init or None,
            truth=task.truth or None,
            seed=task.seed,
            start_s=m.start_s,
            end_s=m.end_s,
            cameras=CameraRequest(
                tuple(Path(path) for path in task.calibrations), model=task.model, may_fall_back=bool(m.fallback)
            ),
        )
        _warm.prepared = prepare(request, config, seeds=max(2, len(m.seeds)), shared=_warm.shared)
        _warm.configuration = asked
    return _warm.prepared


def _beside(task: Task, words: str) -> str:
    """A file that the manifest names, else the words."""
    path = Path(task.home) / path_of(words)
    return str(path) if words and path.is_file() else words


def _write(folder: Path, name: str, document: Mapping[str, Any], task: Task) -> None:
    folder.mkdir()
    write_json(folder / name, _plain(document))
    write_json(folder / "run.json", {"schema": 1, "command": task.manifest.job, "seed": task.seed})


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return str(value) if isinstance(value, Path) else value


def _key_of(name: str, unit: str) -> str:
    words = "".join(letter if letter.isalnum() else "_" for letter in f"{name} {unit}".strip().lower())
    return "_".join(part for part in words.split("_") if part)


_MEASURES = {
    # the gates have their units in their names
    "calib verify": (Measure("pictures", "pictures", "looked at", ""),),
    "map audit": (
        Measure("coverage", "share", "of the outline that was seen", "higher"),
        Measure("explained", "share", "of the returns that the map explains", "higher"),
        Measure("scale", "", "of the map's lengths against the log's", ""),
        Measure("places", "places", "from which scans were looked at", ""),
        Measure("findings", "findings", "rules that complain", "lower"),
        Measure("findings_error", "findings", "of them errors", "lower"),
    ),
    "simulate": (
        Measure("duration_s", "s", "of the log", ""),
        Measure("path_m", "m", "driven", ""),
        Measure("people", "people", "in the map", ""),
        Measure("unmapped_share", "share", "of the returns from what is not in the map", ""),
        Measure("messages", "messages", "recorded", ""),
    ),
}
JOBS: Mapping[str, Callable[[Task, Path], Came]] = {
    "localize": localize_and_evaluate,
    "calib verify": verify,
    "map audit": audit,
    "simulate": simulate,
}
