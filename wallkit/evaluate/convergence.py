"""Errors and health over time -> when the filter was right, when it was wrong, and whether it knew."""

from __future__ import annotations

import numpy as np

from wallkit.core.results import Episode, Errors, Limits, Value
from wallkit.core.steps import Steps
from wallkit.core.types import BoolArray, Health, Int64Array


def judge(errors: Errors, steps: Steps, limits: Limits) -> dict[str, Value]:
    """Convergence, honesty and availability by key, at every scan that has a truth; `errors.rows` point into steps."""
    known = steps.health[errors.rows]
    updates, seconds = _time_to_converge(errors, steps, limits)
    close = f"{limits.converged_m:g} m and {limits.converged_deg:g} deg"
    wrong = f"{limits.lost_m:g} m or {limits.lost_deg:g} deg"
    good = f"{limits.available_m:g} m and {limits.available_deg:g} deg"
    values = (
        Value(
            "updates_to_converge",
            updates,
            "updates",
            f"updates of the filter until the error stays under {close} to the end; 1: right from the first",
        ),
        Value("seconds_to_converge", seconds, "s", "time from the first scan to that update"),
        Value(
            "false_healthy",
            float(np.sum(is_lost(errors, limits) & (known == Health.LOCALIZED))),
            "scans",
            f"scans at which the filter says LOCALIZED while it is more than {wrong} off",
        ),
        Value(
            "availability",
            availability(errors, known, limits),
            "share",
            f"share of the scans within {good} at which the filter says LOCALIZED",
            "higher",
        ),
        Value(
            "lost_episodes",
            float(len(find_episodes(errors, steps, limits))),
            "episodes",
            f"times the estimate went more than {wrong} off",
        ),
        Value(
            "lost_share",
            float(np.mean(is_lost(errors, limits))),
            "share",
            f"share of the scans at which the estimate is more than {wrong} off",
        ),
    )
    return {value.key: value for value in values}


def converged_at(errors: Errors, limits: Limits) -> int | None:
    """Row of `errors` from which the estimate stays converged to the end; None if the last one is not."""
    wrong = np.flatnonzero(~is_converged(errors, limits))
    first = int(wrong[-1]) + 1 if len(wrong) else 0
    return first if first < len(errors) else None


def availability(errors: Errors, known: Int64Array, limits: Limits) -> float | None:
    """Share of the good scans that are called LOCALIZED; None without a good one.

    Args:
        known: (E,) int64, health of the rows of `errors`.
    """
    good = (errors.position_m <= limits.available_m) & (errors.heading_deg <= limits.available_deg)
    return float(np.mean(known[good] == Health.LOCALIZED)) if good.any() else None


def find_episodes(errors: Errors, steps: Steps, limits: Limits) -> tuple[Episode, ...]:
    """Every stretch from the first lost scan to the first converged one after it.

    The two limits differ on purpose: an error that trembles round 1 m is one episode, not twenty.
    """
    lost, converged = is_lost(errors, limits), is_converged(errors, limits)
    episodes, row = [], 0
    while row < len(errors):
        if not lost[row]:
            row += 1
            continue
        back = np.flatnonzero(converged[row:])
        end = row + int(back[0]) if len(back) else len(errors)
        episodes.append(_episode(errors, steps, lost, (row, end)))
        row = end
    return tuple(episodes)


def is_converged(errors: Errors, limits: Limits) -> BoolArray:
    """(E,) bool, position and heading error both under the limits."""
    return (errors.position_m < limits.converged_m) & (errors.heading_deg < limits.converged_deg)


def is_lost(errors: Errors, limits: Limits) -> BoolArray:
    """(E,) bool, position or heading error over the limits."""
    return (errors.position_m > limits.lost_m) | (errors.heading_deg > limits.lost_deg)


def _time_to_converge(errors: Errors, steps: Steps, limits: Limits) -> tuple[float | None, float | None]:
    """Updates and seconds, None if the last scan is wrong; what comes before the truth begins does not count."""
    first = converged_at(errors, limits)
    if first is None:
        return None, None
    seen = steps.is_update[errors.rows[0] : errors.rows[first] + 1]
    # a log that begins with a scan too early for an update is right without one
    return float(max(1, int(np.sum(seen)))), float(errors.stamps_ns[first] - errors.stamps_ns[0]) / 1e9


def _episode(errors: Errors, steps: Steps, lost: BoolArray, span: tuple[int, int]) -> Episode:
    start, end = span
    known = steps.health[errors.rows]
    left = _left_localized(known, start, end)
    said = None if left is None else _first(known[left:end] == Health.LOST, left)
    again = _first(known[end:] == Health.LOCALIZED, end)

    def stamp(row: int | None) -> int | None:
        return None if row is None else int(errors.stamps_ns[row])

    return Episode(
        start_ns=int(errors.stamps_ns[start]),
        recovered_ns=stamp(end if end < len(errors) else None),
        unhealthy_ns=stamp(left),
        said_lost_ns=stamp(said),
        updates_to_lost=None if said is None else _updates_between(steps, errors.rows[start], errors.rows[said]),
        healthy_again_ns=stamp(again),
        worst_m=float(errors.position_m[start:end].max()),
        worst_deg=float(errors.heading_deg[start:end].max()),
        false_healthy=int(np.sum(lost[start:end] & (known[start:end] == Health.LOCALIZED))),
    )


def _left_localized(known: Int64Array, start: int, end: int) -> int | None:
    """Row where the doubt began: the first of the doubting rows that reach into the episode, or the first inside it."""
    if known[start] == Health.LOCALIZED:
        return _first(known[start:end] != Health.LOCALIZED, start)
    healthy_before = np.flatnonzero(known[:start] == Health.LOCALIZED)
    return int(healthy_before[-1]) + 1 if len(healthy_before) else 0


def _updates_between(steps: Steps, start: int, end: int) -> int:
    """Updates after the row `start` up to the row `end`; negative if it lies before."""
    if end < start:
        return -_updates_between(steps, end, start)
    return int(np.sum(steps.is_update[start + 1 : end + 1]))


def _first(found: BoolArray, offset: int) -> int | None:
    rows = np.flatnonzero(found)
    return offset + int(rows[0]) if len(rows) else None
