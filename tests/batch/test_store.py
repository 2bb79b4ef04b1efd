"""The table of a batch: what is noted stays, what is not asked for is kept, and only one driver writes."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from dataclasses import replace

import pytest

from wallkit.batch.rows import Asked, Measure, Outcome
from wallkit.batch.store import FILE, is_batch, open_store, read_about, read_measures, read_rows
from wallkit.errors import OutputError, WallkitError


def asked(name: str, key: str = "") -> Asked:
    return Asked(
        name,
        key or f"key of {name}",
        "localize",
        "log",
        "",
        "",
        "basic",
        0,
        "1",
        {"localize.particles": 5},
        {"people": "4"},
    )


def test_what_is_noted_is_read_back_in_the_order_of_names(tmp_path):
    runs = [asked("b"), asked("a")]
    came = Outcome(runs[0].key, "done", "LOST", 4, "", {"ate_rmse_m": 0.25, "none_m": None}, "w1", 5.0, 2.0, 1.5)
    with open_store(tmp_path) as store:
        store.plan(runs, {"swept": ["localize.particles"]})
        store.add_measures([Measure("ate_rmse_m", "m", "error", "lower"), Measure("wall_s", "s", is_timing=True)])
        store.add(came, "runs/b")
        assert [store.is_waiting(run.key) for run in runs] == [False, True]
        assert store.counts() == {"waiting": 1, "done": 1, "failed": 0}
        # a reader sees it while the driver goes on
        first, second = read_rows(tmp_path)
    assert (first.asked, first.outcome) == (runs[1], Outcome(runs[1].key, "waiting"))
    assert (second.asked, second.outcome, second.folder) == (runs[0], came, "runs/b")
    assert read_measures(tmp_path)["wall_s"].is_timing
    assert read_about(tmp_path) == {"schema": 1, "swept": ["localize.particles"]}
    assert is_batch(tmp_path)
    with sqlite3.connect(tmp_path / FILE) as plain:
        assert plain.execute("SELECT metrics ->> 'ate_rmse_m' FROM runs WHERE status = 'done'").fetchall() == [(0.25,)]
    plain.close()


def test_another_manifest_keeps_what_is_done_and_redoes_what_changed(tmp_path):
    same, changed, gone = asked("same"), asked("changed"), asked("gone")
    with open_store(tmp_path) as store:
        store.plan([same, changed, gone], {})
        for run in (same, changed, gone):
            store.add(Outcome(run.key, "done"), f"runs/{run.name}")
        store.plan([same, replace(changed, key="another")], {})
        assert store.is_waiting("another")
        assert [row.asked.name for row in read_rows(tmp_path)] == ["changed", "same"]
        store.plan([same, changed, gone], {})
        assert store.is_waiting(changed.key)
        assert store.counts()["waiting"] == 1, "what the manifest asks for again was done already"


def test_failures_wait_again_when_asked_to(tmp_path):
    run = asked("a")
    with open_store(tmp_path) as store:
        store.plan([run], {})
        store.add(Outcome(run.key, "failed", exit_code=2, message="no scans"))
        assert not store.is_waiting(run.key)
        store.forget_failures()
        assert store.is_waiting(run.key)


def test_a_second_driver_is_refused_until_the_first_is_dead(tmp_path):
    code = "import sys, time, pathlib\nfrom wallkit.batch.store import open_store\n"
    code += "with open_store(pathlib.Path(sys.argv[1])):\n    print('held', flush=True)\n    time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code, os.fspath(tmp_path)], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match="another batch"), open_store(tmp_path):
            pass
        other.kill()
    with open_store(tmp_path) as store:
        assert store.counts() == {"waiting": 0, "done": 0, "failed": 0}


def test_what_is_no_batch_is_named(tmp_path):
    with pytest.raises(WallkitError, match="no batch"):
        list(read_rows(tmp_path))
    (tmp_path / FILE).write_bytes(b"SQLite format 4 and nothing else, for more than a page of bytes" * 100)
    with pytest.raises(OutputError, match="cannot be used"), open_store(tmp_path):
        pass
