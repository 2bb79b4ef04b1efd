"""`wallkit doctor`: what is installed here, and what it means."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

import wallkit
from wallkit.cli import common

LIBRARIES = (
    "numpy",
    "scipy",
    "numba",
    "opencv-contrib-python-headless",
    "yourdfpy",
    "lxml",
    "shapely",
    "onnxruntime",
    "mcap",
    "mcap-protobuf-support",
    "rosbags",
    "matplotlib",
    "jinja2",
    "click",
    "rich",
)
OPTIONAL = {
    "av": "compressed video in logs: pip install 'wallkit[video]'",
    "onnx": "quantised models and fixtures: pip install 'wallkit[model]'",
}


@click.command()
@common.json_option
@click.pass_context
def doctor(ctx: click.Context, /, as_json: bool) -> None:
    """Say which versions are installed, which optional parts are missing, and whether compiled kernels are kept.

    Exits 0 if all that is needed is there, 1 if not.

    \b
    Examples:
      wallkit doctor
    """
    found = _findings()
    missing = [name for name, version in found["libraries"].items() if version is None]
    if as_json:
        common.emit(found)
    else:
        rows = [[name, version or "MISSING"] for name, version in found["libraries"].items()]
        click.echo(f"wallkit {found['wallkit']}, Python {found['python']}, {found['cpus']} processors")
        click.echo(common.table(["library", "version"], rows))
        for name, use in OPTIONAL.items():
            click.echo(f"optional {name}: {found['optional'][name] or f'not installed ({use})'}")
        click.echo(f"OpenGL for `wallkit simulate` pictures: {_gl_words(found['opengl'])}")
        click.echo(f"onnxruntime providers: {', '.join(found['onnxruntime_providers']) or '-'}")
        click.echo(f"compiled kernels are kept in {found['kernel_cache']}")
    if missing:
        ctx.exit(common.FAILED_CHECK)


def _findings() -> dict[str, Any]:
    import os

    return {
        "wallkit": wallkit.__version__,
        "python": sys.version.split()[0],
        "cpus": os.cpu_count(),
        "libraries": {name: _version(name) for name in LIBRARIES},
        "optional": {name: _version(name) for name in OPTIONAL},
        "opengl": _opengl(),
        "onnxruntime_providers": _providers(),
        "kernel_cache": _kernel_cache(),
    }


def _opengl() -> dict[str, str] | None:
    """Of each backend tried why it does not work, "" if it does; None without MuJoCo."""
    from wallkit.simulate.gl import probe

    return dict(probe()) if _version("mujoco") else None


def _gl_words(reasons: dict[str, str] | None) -> str:
    from wallkit.simulate.gl import APT_LINE, APT_LINE_OSMESA

    if reasons is None:
        return "MuJoCo is not installed (pip install 'wallkit[sim]')"
    works = [name for name, reason in reasons.items() if not reason]
    if works:
        return works[0]
    said = "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
    return f"none ({said}); {APT_LINE}, or {APT_LINE_OSMESA}; masks and LiDAR work without"


def _version(name: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _providers() -> list[str]:
    try:
        import onnxruntime
    except ImportError:
        return []
    return list(onnxruntime.get_available_providers())


def _kernel_cache() -> str:
    """Where Numba keeps what it compiled: beside the package, or in the user's cache where that cannot be written."""
    from wallkit.localize.kernels import sum_of_field

    kernel: Any = sum_of_field
    return str(Path(kernel._cache.cache_path))
