"""A run <-> its folder: trajectories, numbers, provenance, and everything the report needs again."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import wallkit
from wallkit.core.ceiling import CeilingMap
from wallkit.core.config import table_from
from wallkit.core.results import Value
from wallkit.core.steps import Steps, read_steps, write_steps
from wallkit.core.types import OccupancyGrid, Trajectory
from wallkit.errors import WallkitError
from wallkit.evaluate.resources import mark_now, usage_since
from wallkit.evaluate.tum import read_tum, write_tum
from wallkit.logs.layout import write_layout
from wallkit.logs.reader import open_log
from wallkit.maps.ceiling.files import read_ceiling
from wallkit.pipelines.config import Config, LoadedConfig
from wallkit.pipelines.evaluate import Evaluation
from wallkit.pipelines.localize import Run
from wallkit.pipelines.overlays import read_overlays
from wallkit.pipelines.watch import NO_FILTERING
from wallkit.report.data import Photo, Setting, Snapshot, settings_from_tables

RESULT_MCAP = "result.mcap"


@dataclass(frozen=True)
class RunRecord:
    """A run as its folder tells it.

    Attributes:
        name: what was localized. answer: metrics.json. run: run.json.
        grid, snapshots: for the report; missing where result.mcap or snapshots.npz are.
        photos: of OVERLAYS, for the report.
    """

    name: str
    steps: Steps
    answer: dict[str, Any]
    run: dict[str, Any]
    odometry: Trajectory | None
    truth: Trajectory | None
    grid: OccupancyGrid | None
    snapshots: tuple[Snapshot, ...]
    photos: tuple[Photo, ...] = ()

    @property
    def settings(self) -> tuple[Setting, ...]:
        """The effective settings with their defaults and origins."""
        return settings_from_tables(self.run["config"], table_from(Config()), self.run["origins"])

    @property
    def resources(self) -> dict[str, Value]:
        """Time, CPU and memory of the process that made the run, and what its point filters left."""
        known = {**usage_since(mark_now()), **{k: v for k, v in NO_FILTERING.values().items() if k in self.answer}}
        return {k: Value(k, self.answer.get(k), v.unit, v.definition, v.better) for k, v in known.items()}


def record_of(run: Run, evaluation: Evaluation, loaded: LoadedConfig) -> RunRecord:
    """What a run that just ended leaves in its folder."""
    p = run.prepared
    name = " + ".join(path.name for path in p.request.logs)
    return RunRecord(
        name,
        run.steps,
        _answer(run, evaluation),
        _provenance(run, loaded),
        run.odometry,
        p.truth,
        p.map.grid,
        run.snapshots,
    )


def write_run(folder: Path, record: RunRecord) -> None:
    """Everything but result.mcap (written while the filter ran) and the report."""
    write_tum(folder / "estimate.tum", record.steps.trajectory)
    if record.odometry is not None:
        write_tum(folder / "odometry.tum", record.odometry)
    if record.truth is not None:
        write_tum(folder / "truth.tum", record.truth)
    write_steps(folder / "steps.csv", record.steps)
    _write_snapshots(folder / "snapshots.npz", record.snapshots)
    write_json(folder / "metrics.json", record.answer)
    write_json(folder / "run.json", record.run)
    if (folder / RESULT_MCAP).exists():
        cameras = record.run.get("filtering", {}).get("cameras", [])
        annotated = {
            c["picture_topic"]: f"/wallkit/camera/{c['name']}/annotations" for c in cameras if c["picture_topic"]
        }
        write_layout(folder / "foxglove-layout.json", cameras=annotated)


def read_run(folder: Path) -> RunRecord:
    """A run from its folder.

    Raises:
        WallkitError: it is no folder that `wallkit localize` wrote, or one of its files is damaged.
    """
    if not (folder / "run.json").is_file():
        raise WallkitError(
            "no result of wallkit (run.json is missing)", where=folder, hint="name an --out of wallkit localize"
        )
    run = read_json(folder / "run.json")
    # every command of wallkit leaves a run.json
    if "logs" not in run or "config" not in run:
        command = str(run.get("command", "")).removeprefix("wallkit ")
        made_by = f": run.json is of wallkit {command}" if command else ""
        inside = [path.name for path in results_in(folder)]
        hint = f"name one of {', '.join(inside)} in it" if inside else "name an --out of wallkit localize"
        raise WallkitError(f"no result of wallkit localize{made_by}", where=folder, hint=hint)
    truth, odometry = folder / "truth.tum", folder / "odometry.tum"
    return RunRecord(
        " + ".join(Path(log).name for log in run["logs"]),
        read_steps(folder / "steps.csv"),
        read_json(folder / "metrics.json"),
        run,
        read_tum(odometry, frame_id="odom") if odometry.is_file() else None,
        read_tum(truth) if truth.is_file() else None,
        _read_grid(folder / RESULT_MCAP),
        _read_snapshots(folder / "snapshots.npz"),
        read_overlays(folder),
    )


def results_in(folder: Path) -> list[Path]:
    """The result folders of wallkit localize in a folder, by name; what other commands left beside them is passed over."""
    return sorted(path.parent for path in folder.glob("*/run.json") if "command" not in read_json(path))


def seed_folders(folder: Path) -> list[Path]:
    """The folders of the seeds in a result folder, by seed; none if it is that of a single run.

    Raises:
        WallkitError: one is called like a seed and has no number.
    """
    found = [path for path in folder.glob("seed-*") if path.is_dir()]
    for path in found:
        if not path.name.removeprefix("seed-").isdecimal():
            message = f"'{path.name}' is not the folder of a seed: 'seed-' and a number is wanted"
            raise WallkitError(message, where=folder, hint="give it another name, or move it away")
    return sorted(found, key=lambda path: int(path.name.removeprefix("seed-")))


def ceiling_of(run: Mapping[str, Any]) -> CeilingMap | None:
    """The ceiling that run.json names, read again; None if it names none or the file is gone.

    Raises:
        MapError: it is there and cannot be read.
    """
    named = run.get("ceiling")
    return read_ceiling(Path(named)) if named and Path(named).is_file() else None


def dropped(run: Run) -> dict[str, int]:
    """Everything that was left out on the way, by reason."""
    sync, loss = run.sync, run.loss
    return {
        **{f"scans: {reason}": n for reason, n in sorted(sync.scans_dropped.items())},
        **{f"odometry: {reason}": n for reason, n in sorted(sync.odometry_dropped.items())},
        **{f"beams: {reason}": n for reason, n in sorted(sync.beams_dropped.items())},
        **{f"messages of {topic} that could not be decoded": n for topic, n in sorted(loss.undecodable.items())},
    }


def write_json(path: Path, document: Mapping[str, Any]) -> None:
    """A document as JSON; numbers that do not exist are null."""
    path.write_text(json.dumps(_finite(document), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def read_json(path: Path) -> dict[str, Any]:
    """A JSON document.

    Raises:
        WallkitError: it cannot be read.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise WallkitError(f"cannot be read: {error}", where=path, hint="run wallkit localize again") from error
    if not isinstance(document, dict):
        message = f"is {type(document).__name__} in JSON, where an object is wanted"
        raise WallkitError(message, where=path, hint="run wallkit localize again")
    return document


def sha256(path: Path) -> str:
    """Hash of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def machine() -> dict[str, Any]:
    """Where the run took place: for reading timings, not for repeating results."""
    import numba

    return {
        "system": f"{platform.system()} {platform.machine()}",
        "cpus": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


def _answer(run: Run, evaluation: Evaluation) -> dict[str, Any]:
    """metrics.json: the answer, every hypothesis alive at the end, and the numbers by key."""
    e = run.estimate
    of_filters = run.filtering.values() if run.filtering else {}
    numbers = {**evaluation.metrics, **of_filters, **usage_since(run.mark)}
    return {
        "schema": 1,
        "health": e.health.name,
        "reason": run.steps.reasons[-1],
        "pose": _pose(e.pose, np.sqrt(np.diag(e.covariance))),
        "modes": [{**_pose(m.pose, np.sqrt(np.diag(m.covariance))), "share": m.weight} for m in e.modes],
        **{key: value.value for key, value in numbers.items()},
        "filter": run.prepared.config.localize.tracker,
        "seed": run.prepared.request.seed,
    }


def _provenance(run: Run, loaded: LoadedConfig) -> dict[str, Any]:
    """run.json: what was run on what, with which settings, and what was dropped."""
    p = run.prepared
    overhead = [] if p.overhead is None else [p.overhead.path]
    files = _files_of([*p.request.logs, *p.map.files, *overhead, *(p.sight.files if p.sight else ())])
    return {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "argv": sys.argv[1:],
        "seed": p.request.seed,
        "logs": [str(path) for path in p.request.logs],
        "map": p.map.grid.source,
        "ceiling": str(overhead[0]) if overhead else None,
        "scan": p.rig.scan.topic,
        "odometry": str(p.rig.odometry),
        "lidar_mount": p.rig.mount.source,
        "start": p.start if isinstance(p.start, str) else _pose(p.start.pose, np.zeros(3)),
        "inputs": [{"path": str(f), "bytes": f.stat().st_size, "sha256": sha256(f)} for f in files],
        "dropped": dropped(run),
        "lost": run.loss.lines(),
        "notes": [*run.loss.notes, *(str(finding) for finding in p.map.findings), *_notes_on_cameras(run)],
        **({"filtering": run.filtering.document()} if run.filtering else {}),
        "seconds": run.timers.seconds,
        "machine": machine(),
        "config_file": str(loaded.path) if loaded.path else None,
        "config": table_from(loaded.config),
        "origins": loaded.origins,
    }


def _notes_on_cameras(run: Run) -> list[str]:
    p = run.prepared
    notes = [note for camera in (p.sight.cameras if p.sight else ()) for note in camera.notes]
    return [*notes, *([f"the LiDAR alone was used: {p.fallen_back}"] if p.fallen_back else [])]


def _pose(pose: Any, sd: Any) -> dict[str, float]:
    keys = ("x_m", "y_m", "yaw_rad", "sd_x_m", "sd_y_m", "sd_yaw_rad")
    return {key: float(value) for key, value in zip(keys, (*pose, *sd), strict=True)}


def _files_of(paths: Iterable[Path]) -> list[Path]:
    return [f for p in paths for f in (sorted(q for q in p.rglob("*") if q.is_file()) if p.is_dir() else [p])]


def _write_snapshots(path: Path, snapshots: tuple[Snapshot, ...]) -> None:
    arrays: dict[str, Any] = {
        "labels": np.array([s.label for s in snapshots], dtype=np.str_),
        "stamps_ns": np.array([s.stamp_ns for s in snapshots], dtype=np.int64),
    }
    for i, s in enumerate(snapshots):
        arrays[f"poses_{i}"], arrays[f"weights_{i}"] = s.poses.astype(np.float32), s.weights.astype(np.float32)
    np.savez(path, **arrays)


def _read_snapshots(path: Path) -> tuple[Snapshot, ...]:
    if not path.is_file():
        return ()
    with np.load(path, allow_pickle=False) as stored:
        return tuple(
            Snapshot(int(stamp), stored[f"poses_{i}"].astype(float), stored[f"weights_{i}"].astype(float), str(label))
            for i, (stamp, label) in enumerate(zip(stored["stamps_ns"], stored["labels"], strict=True))
        )


def _read_grid(path: Path) -> OccupancyGrid | None:
    return open_log([path]).static.maps.get("/wallkit/map") if path.is_file() else None


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
