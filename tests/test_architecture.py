"""Imports point down only: cli > pipelines > rooms > core > errors, and rooms do not know each other."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import wallkit

PACKAGE = Path(wallkit.__file__).parent
ROOMS = (
    *("logs", "maps", "calib", "segment", "points", "localize", "evaluate", "simulate", "dataset", "train", "report"),
    "batch",
)
HEAVY = {
    "cv2",
    "onnxruntime",
    "yourdfpy",
    "matplotlib",
    "rosbags",
    "mcap",
    "jinja2",
    "rich",
    "trimesh",
    "lxml",
    "shapely",
    "mujoco",
    "torch",
}
# third-party modules that may be imported at the top of a file, by floor
ALLOWED_AT_TOP = {
    "errors": set(),
    "core": {"numpy", "numba", "llvmlite"},
    "room": {"numpy", "numba", "llvmlite", "scipy"},
    "pipelines": {"numpy"},
    "cli": {"click"},
}
# libraries that a whole room is about: light ones, and one that only `model train` imports
OWN_LIBRARIES = {"logs": {"mcap"}, "train": {"torch"}}
FILES = sorted(PACKAGE.rglob("*.py"))


def floor_of(path: Path) -> str:
    top = path.relative_to(PACKAGE).parts[0]
    return "errors" if top in ("errors.py", "__init__.py") else "room" if top in ROOMS else top


def imports(path: Path, *, top_only: bool) -> set[str]:
    """Dotted names of everything a file imports; only what runs when it is imported, or all of it."""
    found: set[str] = set()

    def walk(body):
        for node in body:
            if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
                if not top_only:
                    walk(node.body)
            elif isinstance(node, ast.Import):
                found.update(alias.name for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                found.add(node.module or "")
                found.update(f"{node.module}.{alias.name}" for alias in node.names)
            elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)) and top_only:
                continue
            else:
                walk(child for child in ast.iter_child_nodes(node))

    walk(ast.parse(path.read_text(encoding="utf-8")).body)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down(path):
    own = path.relative_to(PACKAGE).parts[0]
    below = {
        "errors": set(),
        "core": {"core", "errors"},
        "room": {own, "core", "errors"},
        "pipelines": {*ROOMS, "pipelines", "core", "errors", "sample"},
        "cli": {*ROOMS, "cli", "pipelines", "core", "errors"},
        "sample": set(),
    }[floor_of(path)]
    for name in imports(path, top_only=False):
        _, _, rest = name.partition("wallkit.")
        part = rest.split(".")[0]
        if part and ((PACKAGE / part).is_dir() or (PACKAGE / f"{part}.py").exists()):
            assert part in below, f"{path.name} imports {name}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_heavy_imports_stay_inside_functions(path):
    if floor_of(path) == "sample":
        return
    known = {*sys.stdlib_module_names, "wallkit", "__future__", ""}
    third_party = {name.split(".")[0] for name in imports(path, top_only=True)} - known
    allowed = ALLOWED_AT_TOP[floor_of(path)] | OWN_LIBRARIES.get(path.relative_to(PACKAGE).parts[0], set())
    assert third_party <= allowed, f"{path.name} imports {third_party} when it is imported"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_nothing_imports_what_is_agpl(path):
    """Ultralytics is asked in another interpreter, by files."""
    assert not {name for name in imports(path, top_only=False) if name.split(".")[0] == "ultralytics"}


def test_help_imports_nothing_heavy():
    heavy = sorted(HEAVY | {"numpy", "numba", "scipy"})
    code = f"""
import sys
from wallkit.cli.app import main
try:
    main(["--help"])
except SystemExit:
    print(sorted(set(sys.modules) & set({heavy})), file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
    assert "Start here" in done.stdout


def test_no_file_holds_two_ideas():
    """350 lines is where a file starts to hold more than one; the list is for those that were looked at and kept."""
    kept: dict[str, int] = {}
    long = {str(p.relative_to(PACKAGE)): n for p in FILES if (n := len(p.read_text().splitlines())) > 350}
    assert long == kept
