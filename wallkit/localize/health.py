"""What the map says about the scan at the estimate -> LOCALIZED, UNCERTAIN or LOST.

Spread alone cannot tell "well localized among people" from "confidently wrong". The rays can: a return in front of the
mapped surface is somebody standing there (clutter), a return *behind* a mapped surface has gone through a wall, and only a
wrong pose does that. So a pose is judged by hit / (hit + long), and clutter only by whether enough hits are left.

People who stand all around the robot hide the map: nothing fits and nothing contradicts. That is no doubt about the place,
and a search with such a scan would find a room as small as their circle. So odometry carries the estimate on, for a while.

A hypothesis starts unconfirmed. It is confirmed by updates that fit and by a search that finds no rival, and it is given
up after updates that do not fit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wallkit.core.config import setting
from wallkit.core.raycast import LONG
from wallkit.core.types import Float64Array, Health, Int8Array, Mode


@dataclass(frozen=True)
class HealthSettings:
    """When an estimate may be trusted."""

    hit_tolerance_m: float = setting(0.2, "a return this near a surface, or to its predicted range, is a hit", low=0.01)
    hit_tolerance_per_m: float = setting(0.02, "growth of the range tolerance with range: an error of heading", low=0)
    good_explained: float = setting(
        0.75, "hit / (hit + long) from which an update speaks for the estimate", low=0, high=1
    )
    bad_explained: float = setting(0.55, "hit / (hit + long) below which it speaks against it", low=0, high=1)
    good_of_usual: float = setting(0.90, "the same as a share of what is usual on this map", low=0, high=1)
    bad_of_usual: float = setting(0.75, "the same as a share of what is usual on this map", low=0, high=1)
    usual_rate: float = setting(0.05, "rate at which the usual share follows the trusted updates", low=0, high=1)
    least_hits: float = setting(0.15, "share of hits below which an update does not speak for it", low=0, high=1)
    least_reached: float = setting(0.10, "share of hits and longs below which an update says nothing", low=0, high=1)
    spread_max_m: float = setting(0.5, "largest standard deviation of x or y when LOCALIZED", low=0.01)
    spread_max_deg: float = setting(10.0, "largest standard deviation of the heading when LOCALIZED", low=0.1)
    rival_share_max: float = setting(0.05, "largest share of the belief outside the best cluster", low=0, high=1)
    bad_updates_to_lose: int = setting(2, "updates in a row against a hypothesis that end it", low=1)
    doubtful_updates_to_lose: int = setting(6, "updates in a row that do not speak for it that end it", low=1)
    shut_in: float = setting(
        0.5, "share of returns nearer than the map from which people hide it, if next to none reach it", low=0, high=1
    )
    shut_in_updates_to_lose: int = setting(40, "updates in a row with the map hidden that end it", low=1)
    good_updates_to_trust: int = setting(
        4, "updates in a row for a new hypothesis that confirm it if it has no rival", low=1
    )
    path_to_outlive_m: float = setting(
        8.0, "path that confirms it if it had rivals, all of which died on the way", low=0
    )
    path_unsought_m: float = setting(25.0, "the same where the recovery does not search the map for rivals", low=0)
    odometry_gap_s: float = setting(
        10.0, "a longer silence of the odometry makes the estimate a hypothesis again", low=0
    )


@dataclass(frozen=True, slots=True)
class Evidence:
    """What one update has to say.

    Attributes:
        rays: (K,) int8 per return, as `raycast.classify_rays` gives them.
        hit, short, long: their shares; 0 without returns.
        sd: (3,) standard deviation of the estimate [m, m, rad].
        rivals: share of the belief outside the best cluster.
    """

    rays: Int8Array
    hit: float
    short: float
    long: float
    sd: Float64Array
    rivals: float

    @property
    def explained(self) -> float:
        """hit / (hit + long): how well the map explains what reached it; 0 when nothing did."""
        reached = self.hit + self.long
        return self.hit / reached if reached > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Trust:
    """What health remembers between updates.

    Attributes:
        health, reason: the last verdict, and why, in words.
        is_confirmed: the hypothesis was given or has been checked.
        good, bad, doubtful: updates in a row for it, against it, and not for it. shut_in: with the map hidden.
        good_path_m: path driven during the updates in a row for it.
        usual: running mean of hit / (hit + long) while LOCALIZED: how good this map is where the robot is; 0 before.
        usual_hits: the same of the share of hits.
    """

    health: Health = Health.LOST
    reason: str = "no update yet"
    is_confirmed: bool = False
    good: int = 0
    bad: int = 0
    doubtful: int = 0
    shut_in: int = 0
    good_path_m: float = 0.0
    usual: float = 0.0
    usual_hits: float = 0.0


def weigh_evidence(rays: Int8Array, sd: Float64Array, modes: tuple[Mode, ...]) -> Evidence:
    """The evidence of the classified rays for an estimate of the given spread."""
    hit, short, long = (np.bincount(rays, minlength=LONG + 1) / max(len(rays), 1)).tolist()
    rivals = max(0.0, 1.0 - modes[0].weight) if modes else 1.0
    return Evidence(rays, hit, short, long, sd, rivals)


def speaks_for(s: HealthSettings, trust: Trust, e: Evidence) -> bool:
    """Whether an update fits the map as well as an update at the right place does."""
    return e.explained >= max(s.good_explained, s.good_of_usual * trust.usual) and e.hit >= s.least_hits


def speaks_against(s: HealthSettings, trust: Trust, e: Evidence) -> bool:
    """Whether an update fits so badly that the place must be wrong; one that reached nothing says nothing."""
    return e.hit + e.long >= s.least_reached and e.explained < max(s.bad_explained, s.bad_of_usual * trust.usual)


def raises_doubt(s: HealthSettings, trust: Trust, e: Evidence) -> bool:
    """Whether an update fits worse than at the right place; one that reached nothing says nothing."""
    return e.hit + e.long >= s.least_reached and e.explained < max(s.good_explained, s.good_of_usual * trust.usual)


def is_shut_in(s: HealthSettings, e: Evidence) -> bool:
    """Whether something all around the robot hides the map, so that an update says nothing."""
    return e.hit + e.long < s.least_reached and e.short >= s.shut_in


def count_updates(
    settings: HealthSettings,
    before: Trust,
    evidence: Evidence,
    *,
    path_m: float,
    gap_s: float,
    has_jumped: bool,
    is_forced: bool = False,
) -> Trust:
    """Trust with this update counted, and a hypothesis given up that has too much against it; the verdict comes later.

    Args:
        path_m: driven since the last update. gap_s: longest silence of the odometry since then.
        has_jumped: the estimate is not where odometry led it: this is another hypothesis than before.
        is_forced: the robot stood still: seeing the same doubtful scan again and again is no new doubt.
    """
    is_good, is_bad = speaks_for(settings, before, evidence), speaks_against(settings, before, evidence)
    is_hidden = is_shut_in(settings, evidence)
    good = before.good + 1 if is_good else 0
    bad = before.bad + 1 if is_bad else 0
    doubtful = 0 if is_good else before.doubtful + (not is_forced and not is_hidden)
    shut_in = before.shut_in + (not is_forced) if is_hidden else 0
    trust = replace(before, good=good, bad=bad, doubtful=doubtful, shut_in=shut_in)
    is_lost = bad >= settings.bad_updates_to_lose or _is_worn_out(settings, trust)
    confirmed = before.is_confirmed and not (is_lost or has_jumped or gap_s > settings.odometry_gap_s)
    if has_jumped or (before.is_confirmed and not confirmed):
        good = min(good, 1)
    path = before.good_path_m + path_m if good > 1 else 0.0
    return replace(trust, is_confirmed=confirmed, good=good, good_path_m=path)


def is_ripe(settings: HealthSettings, trust: Trust, evidence: Evidence) -> bool:
    """Whether an unconfirmed hypothesis has enough for it that a search for rivals may confirm it."""
    return (
        not trust.is_confirmed
        and trust.good >= settings.good_updates_to_trust
        and evidence.rivals <= settings.rival_share_max
    )


def has_outlived(settings: HealthSettings, trust: Trust, evidence: Evidence, *, were_sought: bool) -> bool:
    """Whether an unconfirmed hypothesis fitted for so long that its rivals had their chance.

    Args:
        were_sought: rivals were searched for and seeded again and again; else only those of the start were ever there.
    """
    path_m = settings.path_to_outlive_m if were_sought else settings.path_unsought_m
    return trust.good_path_m >= path_m and evidence.rivals <= settings.rival_share_max


def judge(settings: HealthSettings, trust: Trust, evidence: Evidence, *, slip: str = "") -> Trust:
    """Trust with its verdict, once the updates are counted and the rivals, if any, are known.

    Args:
        slip: how odometry and the scan disagree, in words; such an update is at best UNCERTAIN, the next one may tell.
    """
    health, reason = _verdict(settings, trust, evidence)
    if health is not Health.LOCALIZED:
        return replace(trust, health=health, reason=reason)
    if slip:
        return replace(trust, health=Health.UNCERTAIN, reason=f"{slip}; the scan fits the map here")
    rate = settings.usual_rate if trust.usual > 0 else 1.0
    usual = trust.usual + rate * (evidence.explained - trust.usual)
    usual_hits = trust.usual_hits + rate * (evidence.hit - trust.usual_hits)
    return replace(trust, health=health, reason=reason, usual=usual, usual_hits=usual_hits)


def _is_worn_out(s: HealthSettings, trust: Trust) -> bool:
    """Whether nothing has spoken for a hypothesis for too long."""
    return trust.doubtful >= s.doubtful_updates_to_lose or trust.shut_in >= s.shut_in_updates_to_lose


def _verdict(s: HealthSettings, trust: Trust, e: Evidence) -> tuple[Health, str]:
    through = f"{e.long:.0%} of the returns lie behind mapped walls"
    if speaks_against(s, trust, e):
        if trust.is_confirmed:
            return Health.UNCERTAIN, f"this scan does not fit the map: {through}"
        return Health.LOST, f"the scan does not fit the map: {through}"
    if not speaks_for(s, trust, e):
        health = Health.LOST if _is_worn_out(s, trust) else Health.UNCERTAIN
        if is_shut_in(s, e):
            return health, f"{e.short:.0%} of the returns end before the map: nothing of it is seen"
        return health, f"only {e.hit:.0%} of the returns fit the map, {through}"
    if not trust.is_confirmed:
        return Health.UNCERTAIN, f"a hypothesis, not yet confirmed ({trust.good} updates in a row for it)"
    spread_m, spread_deg = max(e.sd[0], e.sd[1]), np.rad2deg(e.sd[2])
    if spread_m > s.spread_max_m or spread_deg > s.spread_max_deg:
        return Health.UNCERTAIN, f"spread of {spread_m:.2f} m, {spread_deg:.0f} deg"
    if e.rivals > s.rival_share_max:
        return Health.UNCERTAIN, f"{e.rivals:.0%} of the belief is somewhere else"
    return Health.LOCALIZED, "the scan fits the map"
