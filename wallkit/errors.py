"""What can go wrong, said so that the user can act: an error to stop on, a finding to list."""

from __future__ import annotations

from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, Literal

Severity = Literal["error", "warning", "info"]


class WallkitError(Exception):
    """Something the user can fix. Printed as `where: what (actual values)` and a `hint:` line; exit code 2.

    Args:
        message: what is wrong, with the offending value in it.
        where: file, or file:line, or topic; empty when there is no place to point at.
        hint: what to type or change next.
    """

    exit_code = 2

    def __init__(self, message: str, *, where: object = "", hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.where = str(where)
        self.hint = hint

    def __str__(self) -> str:
        text = f"{self.where}: {self.message}" if self.where else self.message
        return f"{text}\n  hint: {self.hint}" if self.hint else text


class LogError(WallkitError):
    """A recording that cannot be read, or lacks what the command needs."""


class MapError(WallkitError):
    """A map that cannot be read or used."""


class CalibrationError(WallkitError):
    """A camera model, board, capture or calibration file that cannot be read or used."""


class ModelError(WallkitError):
    """A segmentation model that cannot be read, or does not do what is asked of it."""


class SimulationError(WallkitError):
    """A world, robot or scenario that cannot be simulated."""


class DatasetError(WallkitError):
    """A training set that cannot be made or read."""


class ConfigError(WallkitError):
    """A setting that does not exist or has an impossible value."""


class OutputError(WallkitError):
    """A result that cannot be written where it was asked for."""


def closest(name: str, valid: Any) -> str:
    """`did you mean 'x'?` for the closest of the valid names, else the sorted list of them."""
    names = sorted(str(v) for v in valid)
    near = get_close_matches(name, names, n=1)
    listed = ", ".join(names)
    return f"did you mean '{near[0]}'? (one of: {listed})" if near else f"one of: {listed}"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing noticed about a file: rule code, how bad, where, what, and what to do."""

    code: str
    severity: Severity
    file: str
    message: str
    line: int | None = None
    column: int | None = None
    hint: str = ""
    detail: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        place = ":".join(str(p) for p in (self.file, self.line, self.column) if p is not None)
        text = f"{place}: {self.severity} {self.code} {self.message}"
        return f"{text}\n  hint: {self.hint}" if self.hint else text
