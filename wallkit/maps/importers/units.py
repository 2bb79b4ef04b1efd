"""Lengths whose size is known from buildings (door leaves, wall thicknesses, storeys) -> the unit a file is drawn in.

Headers lie: a plan drawn in inches says millimetres when nobody set the unit. A door leaf does not lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import Finding, MapError, closest

METRES: dict[str, float] = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
NAMES: dict[str, str] = {
    "m": "metres",
    "dm": "decimetres",
    "cm": "centimetres",
    "mm": "millimetres",
    "in": "inches",
    "ft": "feet",
}

# what the sizes of these things are in buildings [m]; map-format.md 5.9
PLAUSIBLE_M: dict[str, tuple[float, float]] = {
    "door leaf": (0.6, 1.3),
    "wall thickness": (0.05, 0.6),
    "storey height": (2.0, 6.0),
    "toilet": (0.3, 0.9),
    "extent": (3.0, 500.0),
}
# a unit explains the file when at least this share of the evidence is plausible in it
EXPLAINS = 0.5


@dataclass(frozen=True)
class Evidence:
    """Lengths of one kind of thing (a key of PLAUSIBLE_M), in the file's own unit."""

    kind: str
    lengths: Float64Array


@dataclass(frozen=True)
class UnitVerdict:
    """What the evidence says.

    Attributes:
        declared: the unit the file (or the user) names; None if it names none.
        inferred: the unit that explains the evidence best; None when none explains it or there is no evidence.
        shares: {unit: share of the evidence that is plausible in it}.
        reasons: one line per kind of evidence.
    """

    declared: str | None
    inferred: str | None
    shares: dict[str, float]
    reasons: tuple[str, ...]

    @property
    def contradicts(self) -> bool:
        """The declared unit does not explain the evidence, and another one does."""
        return self.declared is not None and self.inferred is not None and self.shares[self.declared] < EXPLAINS


def judge_units(declared: str | None, evidence: Sequence[Evidence]) -> UnitVerdict:
    """The unit in which most kinds of evidence have plausible sizes; each kind counts the same, however many there are.

    Of units that explain the evidence alike the declared one wins, then the one in which the lengths are nearest the middle
    of their plausible range.
    """
    given = [kind for kind in evidence if len(kind.lengths)]
    shares = {unit: _share(given, scale) for unit, scale in METRES.items()}
    best = max(METRES, key=lambda unit: (round(shares[unit], 3), unit == declared, -_strangeness(given, METRES[unit])))
    inferred = best if given and shares[best] >= EXPLAINS else None
    reasons = tuple(_reason(kind, declared, inferred) for kind in given)
    return UnitVerdict(declared, inferred, shares, reasons)


def finding_of(verdict: UnitVerdict, path: Path, line: int | None = None) -> Finding | None:
    """WK-E041 when the declared unit is contradicted, with the evidence and what to type; None when it is not."""
    if not verdict.contradicts:
        return None
    declared, inferred = str(verdict.declared), str(verdict.inferred)
    return Finding(
        "WK-E041",
        "error",
        str(path),
        f"says {NAMES[declared]}, but looks drawn in {NAMES[inferred]}: {'; '.join(verdict.reasons)}",
        line=line,
        hint=f"read again with --units {inferred} --overwrite, or with --units {declared} if it is right",
        detail={"declared": declared, "inferred": inferred, "shares": verdict.shares},
    )


def check_unit(unit: str, where: object) -> str:
    """The unit, if it is one.

    Raises:
        MapError: it is not.
    """
    if unit not in METRES:
        raise MapError(f"there is no unit '{unit}'", where=where, hint=closest(unit, METRES))
    return unit


def _share(evidence: Sequence[Evidence], scale: float) -> float:
    """Share of the evidence that is plausible at a scale [m per unit of the file]."""
    kinds = []
    for kind in evidence:
        low, high = PLAUSIBLE_M[kind.kind]
        lengths_m = kind.lengths * scale
        kinds.append(float(np.mean((lengths_m >= low) & (lengths_m <= high))))
    return float(np.mean(kinds)) if kinds else 0.0


def _strangeness(evidence: Sequence[Evidence], scale: float) -> float:
    """How far, as a mean logarithm, median lengths are from the middle of their plausible ranges."""
    distances = []
    for kind in evidence:
        low, high = PLAUSIBLE_M[kind.kind]
        distances.append(abs(float(np.log(np.median(kind.lengths) * scale / np.sqrt(low * high)))))
    return float(np.mean(distances)) if distances else 0.0


def _reason(kind: Evidence, declared: str | None, inferred: str | None) -> str:
    median = float(np.median(kind.lengths))
    read = [f"{median * METRES[unit]:.3g} m if {NAMES[unit]}" for unit in dict.fromkeys((declared, inferred)) if unit]
    low, high = PLAUSIBLE_M[kind.kind]
    return f"{kind.kind} {median:.4g} (median of {len(kind.lengths)}): {', '.join(read)}; usual {low:g} to {high:g} m"
