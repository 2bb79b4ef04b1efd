"""What a run costs: the clocks tick, memory is this process's own, phases add up."""

import os
import subprocess
import sys

import numpy as np
import pytest

from wallkit.evaluate.resources import Timers, begin, mark_now, peak_memory_mb, update_times, usage_since


def test_a_busy_loop_uses_about_one_core():
    mark = mark_now()
    while usage_since(mark)["wall_s"].value < 0.2:
        pass
    usage = {key: value.value for key, value in usage_since(mark).items()}
    assert usage["wall_s"] >= 0.2
    assert 0 < usage["cpu_percent"] < 100 * (os.cpu_count() + 1)


def test_peak_memory_sees_what_was_allocated():
    before = peak_memory_mb()
    block = np.ones(int(before * 1e6 / 8) + 20_000_000)  # larger than all there was: the peak must rise by 160 MB
    assert peak_memory_mb() > before + 100
    assert block[-1] == 1


def test_a_run_does_not_report_the_peak_of_the_one_before_it():
    if not os.access("/proc/self/clear_refs", os.W_OK):
        pytest.skip("only Linux can begin anew")
    block = np.ones(40_000_000)
    during = peak_memory_mb()
    del block
    begin()
    assert peak_memory_mb() < during - 200


def test_a_child_does_not_report_its_parents_peak():
    if not os.path.exists("/proc/self/status"):
        pytest.skip("only Linux can tell the two apart")
    block = np.ones(40_000_000)
    code = "from wallkit.evaluate.resources import peak_memory_mb; print(peak_memory_mb())"
    child = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert float(child.stdout) < block.nbytes / 1e6


def test_times_per_update():
    values = update_times(np.arange(1, 101, dtype=float))
    assert [v.value for v in values.values()] == [50.5, 50.5, pytest.approx(95.05)]
    assert all(key.endswith("_ms") for key in values)
    assert update_times(np.array([np.nan, 3.0]))["update_mean_ms"].value == 3.0
    assert {v.value for v in update_times(np.array([np.nan])).values()} == {None}


def test_items_are_timed_while_they_are_made_and_not_while_they_are_used():
    def slow():
        yield from (sum(range(10_000_000)), None)

    timers = Timers()
    assert list(timers.each("read", slow())) == [49999995000000, None]
    made = timers.seconds["read"]
    for _ in timers.each("read", [0]):
        sum(range(10_000_000))
    assert timers.seconds["read"] < 1.5 * made


def test_a_phase_entered_again_adds_up_even_when_it_fails():
    timers = Timers()
    with timers.phase("read"):
        pass
    first = timers.seconds["read"]
    with pytest.raises(KeyError), timers.phase("read"):
        raise KeyError
    with timers.phase("write"):
        pass
    assert timers.seconds["read"] > first > 0
    assert list(timers.seconds) == ["read", "write"]
