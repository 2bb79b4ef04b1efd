"""The run record: what it refuses, and that its CSV gives the same bits back."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from wallkit.core.steps import COLUMNS, Steps, csv_from_steps, health_runs, read_steps, steps_from_csv, write_steps
from wallkit.core.types import Health
from wallkit.errors import OutputError, WallkitError

FLOATS = st.floats(allow_nan=True, width=64)
LINES = st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp")), max_size=20)


@st.composite
def some_steps(draw):
    stamps = sorted(draw(st.sets(st.integers(-(2**62), 2**62), max_size=6)))
    rows = len(stamps)

    def floats(*shape):
        return draw(hnp.arrays(np.float64, (rows, *shape), elements=FLOATS))

    def ints(low, high):
        return draw(hnp.arrays(np.int64, rows, elements=st.integers(low, high)))

    return Steps(
        stamps_ns=np.array(stamps, dtype=np.int64),
        poses=floats(3),
        sd=floats(3),
        health=ints(0, 2),
        hit_ratio=floats(),
        short_ratio=floats(),
        long_ratio=floats(),
        ess=floats(),
        particles=ints(0, 2**40),
        modes=ints(0, 99),
        update_ms=floats(),
        reasons=tuple(draw(st.lists(LINES, min_size=rows, max_size=rows))),
    )


def two_steps(**changes):
    rows = np.arange(2.0)
    values = {
        "stamps_ns": np.array([10, 20]),
        "poses": np.zeros((2, 3)),
        "sd": np.ones((2, 3)),
        "health": np.array([Health.LOST, Health.LOCALIZED]),
        "particles": np.array([100, 50]),
        "modes": np.array([2, 1]),
        "reasons": ("no, nothing fits", ""),
        **dict.fromkeys(("hit_ratio", "short_ratio", "long_ratio", "ess", "update_ms"), rows),
    }
    return Steps(**{**values, **changes})


@given(some_steps())
def test_csv_gives_the_same_bits_back(steps):
    back = steps_from_csv(csv_from_steps(steps))
    for field in dataclasses.fields(Steps):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(steps, field.name), err_msg=field.name)


def test_file_is_readable_by_people(tmp_path):
    write_steps(tmp_path / "steps.csv", two_steps(hit_ratio=np.array([np.nan, 0.5])))
    header, first, second = (tmp_path / "steps.csv").read_text().splitlines()
    assert header.split(",") == list(COLUMNS)
    assert first == '10,0.0,0.0,0.0,1.0,1.0,1.0,LOST,,0.0,0.0,0.0,100,2,0.0,"no, nothing fits"'
    assert second == "20,0.0,0.0,0.0,1.0,1.0,1.0,LOCALIZED,0.5,1.0,1.0,1.0,50,1,1.0,"
    assert len(read_steps(tmp_path / "steps.csv")) == 2


@pytest.mark.parametrize(
    ("change", "place", "what"),
    [
        (lambda text: text.replace("ess", "mess"), "s.csv:1", "'ess'"),
        (lambda text: text.replace("LOST", "FINE"), "s.csv:2", "'FINE' is not a value of column 'health'"),
        (lambda text: text.replace("\n20,", "\n2x,"), "s.csv:3", "'2x' is not a value of column 'stamp_ns'"),
        (lambda text: text[: text.rindex(",1,")], "s.csv:3", "cells where the header has"),
        (lambda text: text.replace("\n20,", "\n5,"), "s.csv", "ascend"),
        (lambda _: "", "s.csv:1", "'stamp_ns'"),
    ],
)
def test_a_damaged_file_is_refused_with_its_line(change, place, what):
    with pytest.raises(WallkitError, match=what) as caught:
        steps_from_csv(change(csv_from_steps(two_steps())), where="s.csv")
    assert caught.value.where == place
    assert caught.value.hint


def test_files_that_cannot_be_opened(tmp_path):
    with pytest.raises(WallkitError, match="cannot read"):
        read_steps(tmp_path / "none.csv")
    with pytest.raises(OutputError, match="cannot write"):
        write_steps(tmp_path / "no" / "steps.csv", two_steps())


@pytest.mark.parametrize(
    "changes",
    [{"ess": np.zeros(3)}, {"poses": np.zeros((2, 2))}, {"stamps_ns": np.array([20, 20])}, {"reasons": ("a\nb", "")}],
)
def test_a_record_that_contradicts_itself_is_a_mistake(changes):
    with pytest.raises(ValueError):
        two_steps(**changes)


@given(hnp.arrays(np.int64, st.integers(0, 30), elements=st.integers(0, 2)))
def test_health_runs_spell_the_column_again(health):
    runs = list(health_runs(health))
    spelt = [value for start, end, value in runs for _ in range(end - start)]
    assert spelt == health.tolist()
    assert all(a[2] != b[2] for a, b in itertools.pairwise(runs))
