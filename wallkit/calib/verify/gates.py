"""Numbers with a bound for good and a bound for bad -> PASS, FAIL or CANNOT TELL, with reasons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.calibration import Verdict


@dataclass(frozen=True, slots=True)
class Gate:
    """One question that was asked of a calibration.

    Attributes:
        name: what was judged, in words. value: the number; NaN when it could not be had. unit: of it, or "".
        wanted: the bound for PASS, in words. verdict: the answer to this question alone; empty when it was not asked.
        reason: why it is no PASS; else "". refused: the bound for FAIL, in words; empty when nothing is.
        basis: where the bounds come from, or how the number is defined.
    """

    name: str
    value: float
    unit: str
    wanted: str
    verdict: Verdict
    reason: str = ""
    refused: str = ""
    basis: str = ""


def below(
    name: str, value: float, unit: str, *, good: float, bad: float = np.inf, reason: str = "", basis: str = ""
) -> Gate:
    """PASS at or below `good`, FAIL above `bad`, CANNOT TELL between them or without a number."""
    verdict: Verdict = "PASS" if value <= good else "FAIL" if value > bad else "CANNOT TELL"
    refused = f"> {bad:g}" if np.isfinite(bad) else ""
    return Gate(name, value, unit, f"<= {good:g}", verdict, "" if verdict == "PASS" else reason, refused, basis)


def above(
    name: str, value: float, unit: str, *, good: float, bad: float = -np.inf, reason: str = "", basis: str = ""
) -> Gate:
    """PASS at or above `good`, FAIL below `bad`, CANNOT TELL between them or without a number."""
    verdict: Verdict = "PASS" if value >= good else "FAIL" if value < bad else "CANNOT TELL"
    refused = f"< {bad:g}" if np.isfinite(bad) else ""
    return Gate(name, value, unit, f">= {good:g}", verdict, "" if verdict == "PASS" else reason, refused, basis)


def not_asked(name: str, reason: str) -> Gate:
    """A question without evidence: it counts neither for nor against."""
    return Gate(name, float("nan"), "", "", "", reason)


def verdict_of(gates: Sequence[Gate]) -> Verdict:
    """FAIL if one gate fails, else CANNOT TELL if one cannot tell, else PASS."""
    given = {gate.verdict for gate in gates}
    return "FAIL" if "FAIL" in given else "CANNOT TELL" if "CANNOT TELL" in given else "PASS"
