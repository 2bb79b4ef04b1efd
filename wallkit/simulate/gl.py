"""Which OpenGL the machine has -> a MuJoCo renderer on it: EGL first, then OSMesa, tried in a process of their own.

A library that is there but broken takes the whole process down, so the first attempt happens elsewhere. Everything but
colour pictures works without any of this.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from wallkit.errors import SimulationError

BACKENDS = ("egl", "osmesa")
APT_LINE = "apt-get install -y --no-install-recommends libegl1 libgl1"
APT_LINE_OSMESA = "apt-get install -y --no-install-recommends libosmesa6"
_PROBE = """
import mujoco
context = mujoco.GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""
_PROBE_S = 60.0


@lru_cache(maxsize=1)
def probe() -> Mapping[str, str]:
    """Of every backend the reason why it does not work, or "" if it does; those after the first that works are not tried."""
    found: dict[str, str] = {}
    for backend in BACKENDS:
        found[backend] = _reason_against(backend)
        if not found[backend]:
            break
    return found


def backend() -> str:
    """The backend that works.

    Raises:
        SimulationError: none does.
    """
    wanted = os.environ.get("WALLKIT_GL", "")
    if wanted in BACKENDS:
        return wanted
    reasons = probe()
    for name, reason in reasons.items():
        if not reason:
            return name
    said = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
    raise SimulationError(
        f"pictures need OpenGL, and none works here ({said})",
        hint=f"{APT_LINE}   (or, without a display server's libraries: {APT_LINE_OSMESA}); masks, LiDAR and odometry work "
        "without it",
    )


def renderer(model: Any, width: int, height: int) -> Any:
    """A mujoco.Renderer of a size on the backend that works.

    Raises:
        SimulationError: none does.
    """
    name = backend()
    os.environ["WALLKIT_GL"] = name
    if os.environ.get("PYOPENGL_PLATFORM", name) != name:
        os.environ["PYOPENGL_PLATFORM"] = name
    import mujoco
    from mujoco.rendering.classic import gl_context

    # MuJoCo chooses when it is first imported, which for LiDAR alone happens without any GL
    gl_context.GLContext = importlib.import_module(f"mujoco.{name}").GLContext
    model.vis.global_.offwidth = max(width, 16)
    model.vis.global_.offheight = max(height, 16)
    return mujoco.Renderer(model, height, width)


def _reason_against(name: str) -> str:
    environment = {**os.environ, "MUJOCO_GL": name}
    environment.pop("PYOPENGL_PLATFORM", None)
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PROBE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no answer in {_PROBE_S:.0f} s"
    if done.returncode == 0:
        return ""
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return lines[-1][:160] if lines else f"ended with {done.returncode}"
