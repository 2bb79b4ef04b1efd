"""A piece of a batch -> its runs done one after the other in this process, each with a folder that says how it ended.

A folder takes its name when its run is done, and holds OUTCOME: whoever comes later, after a sudden end of this process, of
the driver or of the machine, takes it for done and does the rest.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

import wallkit
from wallkit.batch.rows import Outcome
from wallkit.errors import WallkitError
from wallkit.pipelines.batch.here import Here, here
from wallkit.pipelines.batch.jobs import JOBS, Came
from wallkit.pipelines.batch.plan import Task
from wallkit.pipelines.outputs import put_in_place
from wallkit.pipelines.run_folder import write_json

OUTCOME = "outcome.json"

# a run measures its process: two of them in one would measure each other
_one_at_a_time = threading.Lock()


def do_piece(tasks: Sequence[Task], version: str) -> list[Outcome]:
    """The outcome of every run of a piece; a run that fails does not stop the others.

    Args:
        version: of the driver's wallkit; another one does nothing.
    """
    with _one_at_a_time:
        return [_do(task, version) for task in tasks]


def found_done(task: Task) -> Outcome | None:
    """The outcome of a run that was done before; None if it was not, or is of another key."""
    try:
        outcome = Outcome(**json.loads((Path(task.folder) / OUTCOME).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None
    return outcome if outcome.key == task.key else None


def failed(task: Task, message: str, *, started: float = 0.0, seconds: float = 0.0, cpu_s: float = 0.0) -> Outcome:
    """The outcome of a run that could not be done."""
    return Outcome(task.key, "failed", "", WallkitError.exit_code, message, {}, worker_name(), started, seconds, cpu_s)


def worker_name() -> str:
    """This process, for people."""
    return f"{platform.node()}:{os.getpid()}"


def _do(task: Task, version: str) -> Outcome:
    if version != wallkit.__version__:
        return failed(task, f"{worker_name()} has wallkit {wallkit.__version__}, the batch is of {version}")
    before = found_done(task)
    if before is not None:
        return before
    out = Path(task.folder)
    working = out.with_name(f".{out.name}.partial-{os.getpid()}")
    started, wall, cpu = time.time(), time.perf_counter(), time.process_time()
    try:
        came = _try(task, working)
        seconds, cpu_s = time.perf_counter() - wall, time.process_time() - cpu
        if isinstance(came, str):
            return failed(task, came, started=started, seconds=seconds, cpu_s=cpu_s)
        outcome = Outcome(
            task.key,
            "done",
            came.verdict,
            came.exit_code,
            came.message,
            came.metrics,
            worker_name(),
            started,
            seconds,
            cpu_s,
        )
        write_json(working / OUTCOME, asdict(outcome))
        try:
            put_in_place(working, out)
        except WallkitError as error:
            return failed(task, str(error), started=started, seconds=seconds, cpu_s=cpu_s)
        return outcome
    finally:
        with suppress(OSError):
            shutil.rmtree(working)


def _try(task: Task, working: Path) -> Came | str:
    """What came of it, or why nothing did."""
    run = Here(task, {})
    try:
        working.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(working, ignore_errors=True)
        run = here(task)
        came = JOBS[task.manifest.job](run.task, working)
        if run.copies:
            for path in working.glob("*.json"):
                path.write_text(run.as_written(path.read_text(encoding="utf-8")), encoding="utf-8")
    except WallkitError as error:
        return run.as_written(str(error))
    except OSError as error:
        return run.as_written(f"{error.filename or task.log}: {error.strerror or error}")
    except Exception:  # noqa: BLE001  a bug in one run must not take the others with it
        return f"a bug in wallkit, please report it:\n{traceback.format_exc()}"
    numbers = {key: value if value is None else float(value) for key, value in came.metrics.items()}
    finite = {key: value if value is None or abs(value) < float("inf") else None for key, value in numbers.items()}
    return replace(came, message=run.as_written(came.message), metrics=finite)
