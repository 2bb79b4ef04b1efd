"""YAML text -> tables and lists that know their lines, or one clear message."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from wallkit.errors import MapError
from wallkit.maps.importers.imported import read_text


def load_yaml(path: Path, what: str) -> dict[str, Any]:
    """The top table of a YAML file; it and all tables and lists in it keep their lines (see `line_of`).

    Raises:
        MapError: it cannot be read, is not YAML, or is not a table.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    text = read_text(path, what)
    try:
        table = YAML(typ="rt").load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        raise MapError(
            f"not valid YAML: {getattr(error, 'problem', None) or 'see its structure'}",
            where=f"{path}:{mark.line + 1}" if mark else path,
            hint=f"name {what}",
        ) from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        # ruamel lets these through for odd tags, impossible dates and thousands of brackets
        raise MapError(f"not valid YAML: {type(error).__name__} {error}", where=path, hint=f"name {what}") from error
    if not isinstance(table, dict):
        raise MapError("has no keys", where=path, hint=f"name {what}")
    return table


def line_of(holder: Any, key: Any = None) -> int | None:
    """Line (from 1) of a table or list, or of one of its entries; None for a value that keeps none."""
    positions = getattr(holder, "lc", None)
    if positions is None or positions.line is None:
        return None
    if key is None or not positions.data or key not in positions.data:
        return int(positions.line) + 1
    return int(positions.data[key][0]) + 1


def number(value: Any) -> float | None:
    """A finite number, or None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) else None
