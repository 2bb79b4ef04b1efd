"""A request to an interpreter that has Ultralytics -> its answer, by files, offline, with nothing installed on the way."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wallkit.errors import ModelError

VARIABLE = "WALLKIT_YOLO_PYTHON"
SETUP = """\
# an environment of its own: Ultralytics is AGPL-3.0 and wants packages that wallkit does not (1.3 GB, half a minute)
python3 -m venv yv
yv/bin/pip install torch==2.13.0 numpy==2.4.6 opencv-contrib-python-headless==4.13.0.92 pillow==13.0.0 \\
    pyyaml==6.0.3 onnx==1.23.2 onnxruntime==1.27.0 onnxslim==0.1.98 \\
    matplotlib==3.11.2 polars==2.1.0 psutil==7.2.2    # of this line: only `wallkit model train --yolo`
yv/bin/pip install --no-deps ultralytics==8.4.190 torchvision==0.28.0
"""
_SCRIPT = Path(__file__).with_name("child_script.py")
_SAID_LINES = 12


@dataclass(frozen=True)
class Interpreter:
    """A Python that has Ultralytics.

    Attributes:
        is_trusting: checkpoints are pickles, which can run anything; else only plain weights are loaded.
    """

    python: Path
    is_trusting: bool = False


def find_interpreter(named: Path | None, *, is_trusting: bool = False) -> Interpreter:
    """The named one; else of the variable WALLKIT_YOLO_PYTHON; else the one that the program `yolo` on the PATH runs with.

    Raises:
        ModelError: there is none.
    """
    said = named or (Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None)
    if said is not None:
        program = shutil.which(said)
        if program is None:
            where = "--python" if named else VARIABLE
            raise ModelError(f"'{said}' is no program that can be run", where=where, hint="name its bin/python")
        # it runs in another folder, and without following its link, which would lead out of a virtual environment
        return Interpreter(Path(os.path.abspath(program)), is_trusting)
    program = shutil.which("yolo")
    python = _shebang(Path(program)) if program else None
    if python is None:
        hint = "name one with --python, or make one: `wallkit model export --print-setup`"
        raise ModelError("no interpreter with Ultralytics is known", hint=hint)
    return Interpreter(python, is_trusting)


def ask(interpreter: Interpreter, action: str, words: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The answer to a request; `folder` holds both, and what the other side writes.

    Raises:
        ModelError: it fails; with the last lines that it said.
    """
    request, answer = folder / f"{action}.json", folder / f"{action}-answer.json"
    request.write_text(json.dumps({**words, "action": action, "answer": str(answer)}), encoding="utf-8")
    command = [str(interpreter.python), str(_SCRIPT), str(request)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=folder, env=_environment(interpreter, folder), check=False
        )
    except OSError as error:
        raise ModelError(f"cannot be run: {error.strerror}", where=interpreter.python) from error
    if done.returncode or not answer.is_file():
        raise _failure(interpreter, action, done.returncode, done.stdout + done.stderr)
    found = json.loads(answer.read_text(encoding="utf-8"))
    return dict(found)


# ------------------------------------------------------------------------------------------------ details


def _environment(interpreter: Interpreter, folder: Path) -> dict[str, str]:
    """Offline, without installing anything, without touching the user's settings of Ultralytics."""
    kept = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")}
    asked = {
        "YOLO_OFFLINE": "1",
        "YOLO_AUTOINSTALL": "0",
        "YOLO_VERBOSE": "false",
        "YOLO_CONFIG_DIR": str(folder),
        "ULTRALYTICS_SAFE_LOAD": "0" if interpreter.is_trusting else "1",
        "CUDA_VISIBLE_DEVICES": "",
    }
    return {**kept, **asked}


def _failure(interpreter: Interpreter, action: str, code: int, said: str) -> ModelError:
    lines = [line for line in said.splitlines() if line.strip()]
    last = lines[-1].strip() if lines else f"it ended with {code} and said nothing"
    hint = "its last lines:\n    " + "\n    ".join(lines[-_SAID_LINES:])
    if "No module named 'ultralytics'" in said:
        hint = f"{interpreter.python} has no Ultralytics: see `wallkit model export --print-setup`"
    elif "weights_only" in said or "SAFE_LOAD" in said or "UnpicklingError" in said:
        hint = "the checkpoint holds more than weights; if you know who made it, pass --trust"
    return ModelError(f"{action} by Ultralytics failed: {last}", where=interpreter.python, hint=hint)


def _shebang(program: Path) -> Path | None:
    """The interpreter named in a script's first line."""
    with program.open("rb") as file:
        first = file.readline(400).decode("utf-8", errors="replace").strip()
    python = Path(first.removeprefix("#!").split(" ")[0]) if first.startswith("#!") else None
    return (
        python if python is not None and python.name.startswith("python") and python != Path(sys.executable) else None
    )
