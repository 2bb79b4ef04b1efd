"""One difference between two maps, and how it is said."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from wallkit.core.types import Float64Array

ChangeKind = Literal["added", "removed", "renamed", "moved", "changed"]


@dataclass(frozen=True, slots=True)
class Change:
    """One difference.

    Attributes:
        what: "map", "class", "room", "link", "shape", "opening", "joint". name: of it; for shapes and openings LINK/ID.
        text: the whole sentence. field, before, after: what is different, as text.
        detail: figures for JSON.
    """

    kind: ChangeKind
    what: str
    name: str
    text: str
    field: str = ""
    before: str = ""
    after: str = ""
    detail: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Moved:
    """How far a frame moved in the map, and how much it turned."""

    by_m: tuple[float, float, float]
    turned_rad: float
    is_about_z: bool

    @classmethod
    def between(cls, T_before: Float64Array, T_after: Float64Array) -> Moved:
        """The motion from one pose (4, 4) to another."""
        R = T_before[:3, :3].T @ T_after[:3, :3]
        angle = math.acos(float(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0)))
        is_about_z = bool(abs(R[2, 2] - 1.0) < 1e-9)
        if is_about_z:
            angle = math.atan2(R[1, 0], R[0, 0])
        x, y, z = (T_after[:3, 3] - T_before[:3, 3]).tolist()
        return cls((x, y, z), angle, is_about_z)

    @property
    def distance_m(self) -> float:
        """Length of the way."""
        return math.hypot(*self.by_m)

    def is_still(self, tolerance: float) -> bool:
        """Whether it neither moved nor turned by more."""
        return self.distance_m <= tolerance and abs(self.turned_rad) <= tolerance

    @property
    def text(self) -> str:
        """ "moved 3.2 cm (x +0.032), turned +1.5 deg"."""
        said = []
        if self.distance_m > 0 and length_text(self.distance_m) != "0.0 mm":
            ways = [f"{axis} {by:+.3f}" for axis, by in zip("xyz", self.by_m, strict=True) if abs(by) >= 5e-4]
            said.append(f"moved {length_text(self.distance_m)}" + (f" ({', '.join(ways)})" if ways else ""))
        degrees = math.degrees(self.turned_rad)
        if abs(degrees) >= 5e-5:
            said.append(f"turned {degrees:+.4g} deg" + ("" if self.is_about_z else " out of the floor's plane"))
        return ", ".join(said) or f"moved {self.distance_m * 1e6:.2g} um"

    @property
    def detail(self) -> dict[str, Any]:
        """The figures."""
        return {"distance_m": self.distance_m, "by_m": list(self.by_m), "turned_rad": self.turned_rad}


def length_text(metres: float) -> str:
    """A length as people say it: 4.0 mm, 3.2 cm, 1.250 m."""
    if abs(metres) < 0.01:
        return f"{metres * 1000:.1f} mm"
    return f"{metres * 100:.1f} cm" if abs(metres) < 1.0 else f"{metres:.3f} m"


def number_text(value: float) -> str:
    """A number in few digits, never in exponents where it need not."""
    return f"{value:.9g}"


def value_change(
    what: str, said: str, field_: str, before: object, after: object, *, name: str = ""
) -> Iterator[Change]:
    """The change from one value to another, if there is any."""
    if before != after:
        old, new = (_shown(value) for value in (before, after))
        yield Change("changed", what, name or said, f"{said}: {field_} {old or '-'} -> {new or '-'}", field_, old, new)


def number_change(
    what: str,
    said: str,
    field_: str,
    pair: tuple[float | None, float | None],
    unit: str,
    tolerance: float,
    *,
    name: str = "",
) -> Iterator[Change]:
    """The change from one number to another, if it is more than rounding."""
    before, after = pair
    if before == after or (before is not None and after is not None and abs(after - before) <= tolerance):
        return
    if before is not None and after is not None and math.isnan(before) and math.isnan(after):
        return
    old, new = ("-" if value is None else number_text(value) for value in pair)
    suffix = f" {unit}" if unit else ""
    yield Change("changed", what, name or said, f"{said}: {field_} {old} -> {new}{suffix}", field_, old, new)


def _shown(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    if isinstance(value, dict):
        return " ".join(f"{key}:{number_text(share)}" for key, share in value.items())
    return str(value)
