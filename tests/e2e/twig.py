"""A process that has done wallkit's imports and forks a child for every command: as apart as one started anew, sooner."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import sys
import tempfile
import traceback
import warnings
from typing import Any

# what most commands import; never what sets up OpenGL or other interpreters
ROOMS = ("cli", "core", "evaluate", "localize", "logs", "maps", "points", "report", "pipelines.map")
OTHERS = (
    "wallkit.pipelines.seeds",
    "wallkit.pipelines.calib.verify",
    "wallkit.pipelines.calib.intrinsics",
    "cv2",
    "scipy.optimize",
)


def serve() -> None:
    """Requests, a line of JSON each, until the pipe ends; after each command the line of its exit code."""
    _import_all()
    _load_kernels()
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            _be_the_command(json.loads(line))
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _import_all() -> None:
    for room in ROOMS:
        package = importlib.import_module(f"wallkit.{room}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for name in OTHERS:
        importlib.import_module(name)
    # threads that libraries start at import do nothing here that a child would miss
    warnings.filterwarnings("ignore", message=".*fork.*", category=DeprecationWarning)


def _load_kernels() -> None:
    """Two seconds of the sample, localized and thrown away: compiled functions are read once, not by every child."""
    import click.testing
    import cv2

    from wallkit.cli.app import main
    from wallkit.pipelines.demo import LOG, MAP

    # a child has no threads but its first: OpenCV must not begin any here that it would then wait for
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as scratch:
        words = ["localize", str(LOG), "--map", str(MAP), "--end", "2", "--out", f"{scratch}/run", "--quiet"]
        done = click.testing.CliRunner().invoke(main, words)
    assert done.exception is None or isinstance(done.exception, SystemExit), done.output
    cv2.setNumThreads(threads)


def _be_the_command(request: dict[str, Any]) -> None:
    """Never returns: the process ends as `wallkit WORDS...` would."""
    from wallkit.cli.app import main

    os.environ.clear()
    os.environ.update(request["environ"])
    os.chdir(request["cwd"])
    for number, (path, flags) in enumerate(
        [(os.devnull, os.O_RDONLY), (request["out"], os.O_WRONLY), (request["err"], os.O_WRONLY)]
    ):
        os.dup2(os.open(path, flags), number)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.argv = ["-c", *request["words"]]
    code = 0
    try:
        main()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
    except BaseException:  # noqa: BLE001
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    serve()
