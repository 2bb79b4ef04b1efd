"""Words for numbers: units, what does not exist, and what happened before or after."""

import dataclasses

import numpy as np
import pytest

from wallkit.core.results import Spread, Value
from wallkit.core.types import Health
from wallkit.report.wording import doubts, episode_rows, run_rows, spread_text, value_text

from .worlds import SECOND, run, steps, stretched


@pytest.mark.parametrize(
    ("number", "unit", "text"),
    [
        (0.0567, "m", "0.057 m"),
        (1.2345, "deg", "1.23°"),
        (0.9841, "share", "98.4 %"),
        (41.0, "updates", "41"),
        (0.4049, "ms", "0.40 ms"),
        (131.4, "%", "131 %"),
        (3.0, "cells", "3.000 cells"),
    ],
)
def test_numbers_carry_their_unit(number, unit, text):
    assert value_text(Value("k", number, unit, "")) == text


def test_missing_numbers():
    assert value_text(Value("seconds_to_converge", None, "s", "")) == "never"
    assert value_text(Value("ate_rmse_m", None, "m", "")) == "none"


def test_spreads():
    assert spread_text(Spread("ate_rmse_m", "m", 0.05, 0.01, 0.08, 10, 0)) == "0.050 m ± 0.010 m, worst 0.080 m"
    assert spread_text(Spread("t", "s", 4.0, None, None, 2, 1)) == "4.0 s, 1 of 2 without"
    assert spread_text(Spread("ate_rmse_m", "m", 0.05, None, 0.05, 1, 0)) == "0.050 m"
    assert spread_text(Spread("updates_to_converge", "updates", None, None, None, 3, 3)) == "never"


def test_doubts_reach_until_the_filter_is_sure_again():
    (doubt,), left_out = doubts(steps())
    assert (doubt.start, doubt.length, doubt.said) == ("30.0 s", "12.0 s", "LOST")
    assert doubt.reason == "few beams end on the map"
    assert left_out == 0


def test_a_doubt_that_never_ends_ends_with_the_log():
    record = steps(healthy=True)
    health = record.health.copy()
    health[-3:] = Health.UNCERTAIN
    (doubt,), _ = doubts(dataclasses.replace(record, health=health))
    assert (doubt.start, doubt.length, doubt.said) == ("57.0 s", "2.0 s", "UNCERTAIN")


def test_the_longest_doubts_stay_in_order_of_time():
    health = np.where(np.arange(180) % 4 == 0, Health.UNCERTAIN, Health.LOCALIZED)
    health[100:110] = Health.LOST
    found, left_out = doubts(stretched(steps(), health))
    starts = [float(doubt.start.split()[0]) for doubt in found]
    assert len(found) == 30
    assert starts == sorted(starts)
    assert 100.0 in starts
    assert left_out == 45 - 2 - 30


def test_an_episode_in_words():
    (row,) = episode_rows(run())
    assert (row.start, row.length, row.worst) == ("30.0 s", "10.0 s", "2.00 m, 0°")
    assert (row.doubted, row.said_lost, row.healthy_again) == ("at once", "at once", "never")
    (episode,) = run().episodes
    early = dataclasses.replace(
        episode,
        unhealthy_ns=episode.start_ns - 2 * SECOND,
        said_lost_ns=episode.start_ns + 3 * SECOND,
        updates_to_lost=3,
        recovered_ns=None,
    )
    (row,) = episode_rows(run(episodes=(early,)))
    assert (row.length, row.doubted, row.said_lost) == ("to the end", "2.0 s before", "3.0 s later (3 updates)")


def test_the_run_record_in_rows():
    rows = dict(run_rows({"argv": ["wallkit", "a b"], "config": {"x": 1}, "machine": {"cores": 2}, "seed": None}))
    assert rows == {"argv": "wallkit 'a b'", "machine.cores": "2", "seed": "null"}
