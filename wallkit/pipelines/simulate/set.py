"""A set of scenes, crowds and seeds -> a folder with a log of each; what is there already is not made again."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wallkit.errors import OutputError
from wallkit.pipelines.outputs import write_whole
from wallkit.pipelines.simulate.log import LogRequest, check_pictures, recipe, simulate_log
from wallkit.simulate.robot import DEFAULT_ROBOT
from wallkit.simulate.scenario_set import Take, takes_of

# what the same scans and poses must have in common, whatever OpenGL there is
HASHED = ("/scan", "/odom", "/ground_truth/pose")
HASHES = "hashes.json"
Observe = Callable[[int, str], None]


@dataclass(frozen=True)
class SetRequest:
    """Which logs of which set.

    Attributes:
        only: patterns of names, as restroom-4-*; none: all.
        pictures: False leaves the cameras out; scans and poses stay the same.
    """

    folder: Path
    only: tuple[str, ...] = ()
    pictures: bool = True


@dataclass(frozen=True)
class BuiltSet:
    """What is there now.

    Attributes:
        made, kept: names of logs that were recorded, and of those that were there.
        differ: names whose scans, odometry or poses are not those of the set's hashes.json. unknown: not in it.
        logs: a row of the manifest for each log that was asked for.
    """

    made: tuple[str, ...]
    kept: tuple[str, ...]
    differ: tuple[str, ...]
    unknown: tuple[str, ...]
    logs: tuple[dict[str, Any], ...]

    @property
    def size_bytes(self) -> int:
        return sum(row["bytes"] for row in self.logs)


def requests_of(request: SetRequest) -> dict[str, LogRequest]:
    """What to record, by name.

    Raises:
        ConfigError, SimulationError: see takes_of; no OpenGL works and pictures are asked for.
    """
    found = {take.name: _request(take, pictures=request.pictures) for take in takes_of(request.folder, request.only)}
    for one in found.values():
        check_pictures(one.scenario)
    return found


def simulate_set(
    request: SetRequest, out: Path, *, jobs: int = 1, observe: Observe = lambda done, name: None
) -> BuiltSet:
    """A folder for each log and manifest.json over all that are there. Stopped, it goes on when started again.

    Args:
        jobs: logs that are recorded at once.
        observe: told how many are there, and the name of the latest.

    Raises:
        OutputError: `out` cannot be written, or something else has the name of a log. Else as requests_of and simulate_log.
    """
    wanted = requests_of(request)
    if out.exists() and not out.is_dir():
        raise OutputError("is a file, not a folder", where=out, hint="choose another --out")
    out.mkdir(parents=True, exist_ok=True)
    kept = tuple(name for name, one in wanted.items() if is_made(out / name, one))
    left = {name: one for name, one in wanted.items() if name not in kept}
    observe(len(kept), kept[-1] if kept else "")
    for count, name in enumerate(_each(left, out, jobs), start=len(kept) + 1):
        observe(count, name)
    rows = [_row(folder) for folder in sorted(path.parent for path in out.glob("*/manifest.json"))]
    write_whole(out / "manifest.json", _document({"schema": 1, "set": request.folder.name, "logs": rows}))
    asked = tuple(row for row in rows if row["name"] in wanted)
    differ, unknown = _compared(request.folder, asked)
    return BuiltSet(tuple(left), kept, differ, unknown, asked)


def freeze(folder: Path, built: BuiltSet) -> None:
    """Writes the set's hashes.json: what everybody who builds it should get."""
    known = _hashes(folder)
    known.update({row["name"]: row["sha256"] for row in built.logs})
    write_whole(folder / HASHES, _document(dict(sorted(known.items()))))


def is_made(folder: Path, request: LogRequest) -> bool:
    """Whether a folder holds this very log, made by these versions."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    wanted = json.loads(json.dumps(recipe(request)))
    return all(manifest.get(key) == value for key, value in wanted.items())


# -------------------------------------------------------------------------------------------- details


def _request(take: Take, *, pictures: bool) -> LogRequest:
    scenario = take.scenario if pictures else replace(take.scenario, cameras=())
    return LogRequest(take.map_path, scenario, take.robot_path or DEFAULT_ROBOT, take.seed)


def _each(left: dict[str, LogRequest], out: Path, jobs: int) -> Iterator[str]:
    """Records logs, several at once if asked; their names as they are done."""
    if jobs <= 1 or len(left) < 2:
        for name, one in left.items():
            simulate_log(one, out / name, overwrite=True)
            yield name
        return
    import multiprocessing

    # OpenGL does not live through a fork
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(left)), mp_context=context) as pool:
        waiting = {pool.submit(simulate_log, one, out / name, overwrite=True): name for name, one in left.items()}
        try:
            for future in as_completed(waiting):
                future.result()
                yield waiting[future]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _row(folder: Path) -> dict[str, Any]:
    """A log in the set's manifest."""
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    told = ("seed", "duration_s", "path_m", "people", "unmapped_share", "wallkit", "mujoco", "numpy")
    return {
        "name": folder.name,
        **{key: manifest[key] for key in told},
        "cameras": sorted(manifest["cameras"]),
        "bytes": sum(path.stat().st_size for path in folder.iterdir()),
        "sha256": {topic: manifest["sha256"][topic] for topic in HASHED},
    }


def _compared(folder: Path, rows: Sequence[dict[str, Any]]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    known = _hashes(folder)
    differ = tuple(row["name"] for row in rows if known.get(row["name"], row["sha256"]) != row["sha256"])
    return differ, tuple(row["name"] for row in rows if row["name"] not in known)


def _hashes(folder: Path) -> dict[str, Any]:
    path = folder / HASHES
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else {}


def _document(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=1) + "\n").encode()
