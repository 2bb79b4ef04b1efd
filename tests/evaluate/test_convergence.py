"""When it was right, when it was wrong, and whether it knew: small stories with known endings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wallkit.core.results import Errors, Limits
from wallkit.core.types import Health
from wallkit.evaluate.convergence import availability, converged_at, find_episodes, judge

from .worlds import steps_with

L, U, X = Health.LOCALIZED, Health.UNCERTAIN, Health.LOST
SECOND = 1_000_000_000


def errors_from(position_m, heading_deg=None, first_row=0):
    """Errors at one update a second."""
    rows = first_row + np.arange(len(position_m))
    heading_deg = np.zeros(len(position_m)) if heading_deg is None else np.array(heading_deg, dtype=float)
    return Errors(rows * SECOND, rows, np.array(position_m, dtype=float), heading_deg)


@pytest.mark.parametrize(
    ("position_m", "heading_deg", "first"),
    [
        ([0.1, 0.1, 0.1], None, 0),
        ([9, 0.1, 2, 0.4, 0.3], None, 3),
        ([0.1, 0.1, 0.5], None, None),
        ([9, 0.1, 0.1], [0, 10, 9], 2),
    ],
)
def test_convergence_counts_to_the_end(position_m, heading_deg, first):
    errors = errors_from(position_m, heading_deg)
    assert converged_at(errors, Limits()) == first
    values = judge(errors, steps_with([L] * len(errors)), Limits())
    assert values["updates_to_converge"].value == (None if first is None else first + 1)
    assert values["seconds_to_converge"].value == first


def test_false_healthy_and_availability():
    errors = errors_from([0.1, 0.1, 0.1, 0.6, 1.5, 0.1, 0.2], [0, 0, 0, 0, 0, 31, 6])
    health = np.array([L, U, L, L, L, L, L])
    values = judge(errors, steps_with(health), Limits())
    assert values["false_healthy"].value == 2
    assert values["availability"].value == pytest.approx(2 / 3)
    assert values["lost_episodes"].value == 1
    assert values["lost_share"].value == pytest.approx(2 / 7)


def test_availability_without_a_good_update_does_not_exist():
    assert availability(errors_from([2, 3]), np.array([X, X]), Limits()) is None


def test_health_is_looked_up_at_the_updates_that_have_a_truth():
    health = np.array([L, L, X, X])
    assert judge(errors_from([5, 5], first_row=2), steps_with(health), Limits())["false_healthy"].value == 0
    assert judge(errors_from([5, 5], first_row=0), steps_with(health), Limits())["false_healthy"].value == 2


def test_an_episode_that_was_noticed_and_ended():
    errors = errors_from([0.1, 0.1, 1.2, 3.0, 0.9, 1.1, 0.8, 0.2, 0.1])
    health = np.array([L, U, U, U, X, X, U, U, L])
    (episode,) = find_episodes(errors, steps_with(health), Limits())
    assert episode.start_ns == 2 * SECOND
    assert episode.unhealthy_ns == 1 * SECOND  # doubted one update before it was wrong
    assert (episode.said_lost_ns, episode.updates_to_lost) == (4 * SECOND, 2)
    assert episode.recovered_ns == 7 * SECOND  # 0.9 and 0.8 m are not yet right
    assert episode.healthy_again_ns == 8 * SECOND
    assert (episode.worst_m, episode.worst_deg, episode.false_healthy) == (3.0, 0.0, 0)


def test_an_episode_nobody_noticed():
    (episode,) = find_episodes(errors_from([0.1, 2, 2]), steps_with([L, L, L]), Limits())
    assert (episode.unhealthy_ns, episode.said_lost_ns, episode.recovered_ns, episode.healthy_again_ns) == (None,) * 4
    assert episode.updates_to_lost is None
    assert episode.false_healthy == 2


def test_a_late_doubt_is_late():
    (episode,) = find_episodes(errors_from([0.1, 2, 2, 2, 0.1]), steps_with([L, L, U, X, L]), Limits())
    assert episode.unhealthy_ns == 2 * SECOND
    assert episode.updates_to_lost == 2
    assert episode.false_healthy == 1


def test_scans_without_an_update_do_not_count_as_updates():
    nan = np.nan
    steps = steps_with([U, L, U, U, U, X, X, L], update_ms=[1, nan, 1, nan, 1, nan, 1, 1])
    errors = errors_from([9, 9, 0.1, 2, 2, 2, 2, 0.1])
    (_, episode) = find_episodes(errors, steps, Limits())
    assert episode.said_lost_ns == 5 * SECOND
    assert episode.updates_to_lost == 1
    assert judge(errors, steps, Limits())["updates_to_converge"].value == 5


def test_saying_lost_before_it_is_lost_is_a_negative_delay():
    (episode,) = find_episodes(errors_from([0.1, 0.1, 0.1, 2, 0.1]), steps_with([L, X, U, U, L]), Limits())
    assert episode.updates_to_lost == -2


@given(st.lists(st.tuples(st.floats(0, 3), st.floats(0, 90), st.sampled_from([L, U, X])), min_size=1, max_size=30))
def test_episodes_hold_every_lost_update_once(rows):
    position_m, heading_deg, health = (list(column) for column in zip(*rows, strict=True))
    errors, limits = errors_from(position_m, heading_deg), Limits()
    episodes = find_episodes(errors, steps_with(health), limits)
    lost = (errors.position_m > limits.lost_m) | (errors.heading_deg > limits.lost_deg)
    inside = np.zeros(len(errors), dtype=int)
    for episode in episodes:
        end_ns = len(errors) * SECOND if episode.recovered_ns is None else episode.recovered_ns
        inside += (errors.stamps_ns >= episode.start_ns) & (errors.stamps_ns < end_ns)
    assert inside.max(initial=0) <= 1
    assert np.all(inside[lost] == 1)
    assert sum(e.false_healthy for e in episodes) == judge(errors, steps_with(health), limits)["false_healthy"].value
