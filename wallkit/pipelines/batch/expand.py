"""A sweep -> its points: all combinations, points drawn at random, or a Sobol sequence that fills the space evenly."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array
from wallkit.errors import ConfigError


@dataclass(frozen=True)
class Sweep:
    """The [sweep] of a manifest; what it varies stands in [sweep.over]: a list, or {low, high, log, integer}."""

    kind: Literal["grid", "random", "sobol"] = setting("grid", "all combinations of lists, random points, or Sobol's")
    count: int = setting(16, "points of random and sobol; of sobol best a power of two", low=1)
    seed: int = setting(0, "of random and sobol", low=0)


def expanded(sweep: Sweep, over: Mapping[str, Any], *, where: str) -> list[dict[str, Any]]:
    """The points, each {dotted key: value}.

    Raises:
        ConfigError: something is neither a list nor a range, or a grid has a range.
    """
    for key, values in over.items():
        _check(key, values, is_grid=sweep.kind == "grid", where=where)
    if sweep.kind == "grid":
        return [dict(zip(over, point, strict=True)) for point in itertools.product(*over.values())]
    at = _unit_points(sweep, len(over))
    return [{key: _value(values, u) for (key, values), u in zip(over.items(), row, strict=True)} for row in at.tolist()]


def _unit_points(sweep: Sweep, dimensions: int) -> Float64Array:
    """(count, dimensions) in [0, 1)."""
    if sweep.kind == "random":
        return np.random.default_rng(sweep.seed).random((sweep.count, dimensions))
    from scipy.stats import qmc

    # the balance of a Sobol sequence holds for powers of two (Owen 2020); others are the beginning of one
    sobol = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(sweep.seed))
    return np.asarray(sobol.random_base2((sweep.count - 1).bit_length())[: sweep.count])


def _value(values: Any, u: float) -> Any:
    """The value at a place u in [0, 1) of a list or a range."""
    if isinstance(values, Sequence):
        return values[int(u * len(values))]
    low, high = float(values["low"]), float(values["high"])
    if values.get("integer", False):
        # the whole numbers get equal shares, the ends too
        low, high = low - 0.5, high + 0.5
    value = low * (high / low) ** u if values.get("log", False) else low + (high - low) * u
    return round(value) if values.get("integer", False) else value


def _check(key: str, values: Any, *, is_grid: bool, where: str) -> None:
    if isinstance(values, list) and values:
        return
    hint = f'"{key}" = [1, 2, 3], or {{ low = 1, high = 10, log = true, integer = true }} with random or sobol'
    if not isinstance(values, Mapping):
        raise ConfigError(f"'{key}' is swept over {values!r}, no list and no range", where=where, hint=hint)
    if is_grid:
        raise ConfigError(f"a grid needs the values of '{key}' as a list", where=where, hint=hint)
    low, high = values.get("low"), values.get("high")
    is_known = set(values) <= {"low", "high", "log", "integer"}
    if not (
        is_known
        and isinstance(low, int | float)
        and isinstance(high, int | float)
        and low < high
        and (low > 0 or not values.get("log", False))
    ):
        raise ConfigError(f"'{key}' has the range {dict(values)}", where=where, hint=hint)
