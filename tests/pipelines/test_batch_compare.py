"""A batch with known differences: they are found, equals stay equal, and no run is dropped in silence."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.pipelines.batch_runs import PEOPLE, PLACES, SEEDS, TAKES, drawn, drawn_rows
from wallkit.cli.app import main
from wallkit.errors import WallkitError
from wallkit.pipelines.batch.compare import Question, compare_batch
from wallkit.pipelines.batch.gather import gather
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.pipelines.batch.runs import (
    DONE,
    FAILED,
    MISSING,
    levels_of,
    natural,
    setting_text,
    where,
    with_parts_of_names,
)
from wallkit.report import batch_tables as tables
from wallkit.report import batch_words as words

EACH = len(PLACES) * len(PEOPLE) * len(TAKES) * len(SEEDS)


def told(runs, **question):
    return compare_batch(runs, Question(**question), title="night")


def test_a_gain_of_a_fifth_is_found_and_said_and_an_equal_is_not():
    data = told(drawn({"basic": 1.0, "soft": 0.8, "same": 1.0}))
    soft, same = data.differences["error_mean_m"]
    assert (soft.found.better, same.found.better) == ("b", "neither")
    assert soft.found.percent.low < -20 < soft.found.percent.high
    line = words.difference_line(soft, "error_mean_m", "basic")
    assert line.startswith("soft: 20 % lower error than basic, 95 % interval ")
    assert line.endswith("p < 0.001, 18 logs, better on 18")
    assert words.difference_line(same, "error_mean_m", "basic").startswith("same: no difference from basic can be told")
    assert [c.name for c in data.contest.candidates if c.may_be] == ["soft"]
    assert words.contest_lines(data.contest, data.key)[0].startswith("Best by error: soft (")


def test_the_same_runs_twice_differ_in_nothing():
    rows = list(drawn_rows({"basic": 1.0}))
    runs = gather([*rows, *(replace(row, configuration="twin") for row in rows)], labels_of_runs())
    (difference,) = told(runs).differences["error_mean_m"]
    assert (difference.found.p_holm, difference.found.difference.low, difference.found.difference.high) == (1, 0, 0)
    assert "the same error" in words.difference_line(difference, "error_mean_m", "basic")


def test_every_run_is_counted_whatever_became_of_it():
    gone = [("soft", "hall-0-1", s) for s in SEEDS]
    broken = [("soft", "lab-12-2", 0), ("basic", "lab-0-1", 1)]
    runs = drawn({"basic": 1.0, "soft": 0.8}, left_out=gone, failing=broken)
    assert [int((runs.status == s).sum()) for s in (DONE, FAILED, MISSING)] == [2 * EACH - 5, 2, 3]
    data = told(runs)
    assert [(s.done, s.failed, s.missing) for s in data.summaries] == [(EACH - 1, 1, 0), (EACH - 4, 1, 3)]
    (soft,) = data.differences["error_mean_m"]
    assert (soft.found.pairs, soft.found.alone_a, soft.found.alone_b, soft.found.units) == (EACH - 5, 4, 1, 17)
    line = words.difference_line(soft, "error_mean_m", "basic")
    assert line.endswith("left out for want of a partner: 4 runs of basic, 1 run of soft")
    assert (data.contest.logs, data.contest.of_logs) == (17, 18)
    said = list(words.run_lines(data.failed, "failed"))
    assert said == [
        "2 runs failed:",
        *(f"  {n}: no scans on /scan" for n in ("basic, lab-0-1, seed 1", "soft, lab-12-2, seed 0")),
    ]
    assert [(r.log, r.seed) for r in data.missing] == [("hall-0-1", s) for s in SEEDS]
    assert tables.error_table(data)[1][1][:4] == ["soft", str(EACH - 4), "1", "3"]


def test_a_factor_read_from_the_names_shows_where_it_helps():
    runs = with_parts_of_names(
        drawn({"basic": 1.0, "soft": lambda people: 0.7 if people else 1.0}, seed=1), "{place}-{people}-{take}"
    )
    data = told(runs, by=("people", "crowd"))
    people, crowd = data.factors
    assert [level.name for level in people.levels] == ["0", "2", "12"]
    found = [level.differences["error_mean_m"][0].found for level in people.levels]
    assert [f.better for f in found] == ["neither", "b", "b"]
    assert [f.units for f in found] == [6, 6, 6]
    # one comparison in each level: nothing to correct; all six logs agree
    assert found[1].p_holm == found[1].p_value == 2 / 2**6
    assert "too few" not in words.star_line(data)
    # the tag of the manifest is the same factor
    assert [level.summaries[0].done for level in crowd.levels] == [18, 18, 18]
    headers, rows = tables.factor_table(people, "error_mean_m")
    assert headers == ["people =", "0 (6 logs)", "2 (6 logs)", "12 (6 logs)"]
    assert [cell.endswith("%*") for cell in rows[1][1:]] == [False, True, True]


def test_another_baseline_and_metric():
    data = told(drawn({"basic": 1.0, "soft": 0.8}), baseline="soft", metrics=("update_mean_ms",))
    (basic,) = data.differences["update_mean_ms"]
    assert (basic.name, basic.found.better, basic.found.percent.value) == ("basic", "b", -75.0)
    assert [r.configuration for r in data.worst[:3]] == ["soft"] * 3


def test_only_some_of_the_logs():
    data = told(where(drawn({"basic": 1.0, "soft": 0.8}), "crowd=2, 12"))
    assert (data.logs, data.summaries[0].done, data.differences["error_mean_m"][0].found.units) == (12, 36, 12)
    data = told(where(drawn({"basic": 1.0, "soft": 0.8, "same": 1.0}), "configuration=same,soft"))
    assert [s.name for s in data.summaries] == ["soft", "same"]
    few = told(where(drawn({"basic": 1.0, "soft": 0.8}), "log=hall-0-1,lab-0-1"))
    (soft,) = few.differences["error_mean_m"]
    assert "2 logs, better on 2 (too few: p cannot be below 0.5)" in words.difference_line(soft, few.key, "basic")
    assert words.contest_lines(few.contest, few.key) == ["The best cannot be named: 2 logs that all have are too few."]
    for bad, message in (("crowd", "says no values"), ("crowd=3", "no run has crowd = 3"), ("size=1", "by 'size'")):
        with pytest.raises(WallkitError, match=message):
            where(drawn({"basic": 1.0}), bad)


def test_a_gain_that_a_few_logs_decide_is_called_that():
    """Better on most logs and lost on two: neither better nor worse."""
    rows = list(drawn_rows({"basic": 1.0, "soft": 0.8}))
    lost = {("soft", "hall-0-1"), ("soft", "office-2-2")}
    spoilt = [
        replace(r, metrics={**r.metrics, "error_mean_m": 2.0}) if (r.configuration, r.log) in lost else r for r in rows
    ]
    (soft,) = told(gather(spoilt, labels_of_runs())).differences["error_mean_m"]
    assert soft.found.better == "neither"
    line = words.difference_line(soft, "error_mean_m", "basic")
    assert line.startswith("soft: error is better on 16 of 18 logs than with basic (-18.4 % on the middle one")
    assert "% higher with a 95 % interval" in line
    assert line.endswith("is decided by a few")


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ({"baseline": "hard"}, "no configuration 'hard'"),
        ({"metrics": ("ate",)}, "the number 'ate'"),
        ({"by": ("people",)}, "told apart by 'people'"),
    ],
)
def test_what_does_not_exist_is_named_with_what_does(question, message):
    with pytest.raises(WallkitError, match=message) as found:
        told(drawn({"basic": 1.0, "soft": 0.8}), **question)
    assert "one of: " in found.value.hint


def test_patterns_that_do_not_fit():
    runs = drawn({"basic": 1.0})
    with pytest.raises(WallkitError, match="does not fit 18 of 18 logs, first 'hall-0-1'"):
        with_parts_of_names(runs, "{place}_{people}")
    with pytest.raises(WallkitError, match="names no part"):
        with_parts_of_names(runs, "place-people")
    assert [name for name, _ in levels_of(runs, "crowd")] == ["0", "2", "12"]
    assert [setting_text(v) for v in (["a", "b"], [], None, 0.1234567)] == ["a+b", "none", "default", "0.1235"]
    assert sorted(["b12", "b2", "10", "9", "a"], key=natural) == ["9", "10", "a", "b2", "b12"]


def test_runs_without_a_single_number():
    with pytest.raises(WallkitError, match=f"none of the {EACH} runs has a number to compare"):
        told(replace(drawn({"basic": 1.0}), columns={}))


def test_a_batch_that_has_nothing_yet():
    every = [row.key.split("/") for row in drawn_rows({"basic": 1.0})]
    runs = drawn({"basic": 1.0}, failing=[(name, log, int(seed)) for name, log, seed in every])
    with pytest.raises(WallkitError, match=f"none of {EACH} runs has ended: {EACH} failed, 0 are missing"):
        told(runs)


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """Two folders of result folders, with the only files the comparison reads."""
    for row in drawn_rows({"basic": 1.0, "soft": 0.8}, failing=[("soft", "hall-0-1", 1)]):
        folder = tmp_path / row.configuration / row.log / f"seed-{row.seed}"
        folder.mkdir(parents=True)
        (folder.parent / "run.json").write_text("{}")
        if row.metrics:
            (folder / "metrics.json").write_text(json.dumps({"seed": row.seed, **row.metrics}))
            (folder / "run.json").write_text(json.dumps({"config": {"localize": {"count": 500}}}))
    monkeypatch.chdir(tmp_path)


def test_folders_of_result_folders_are_read_as_a_batch(folders):
    done = CliRunner().invoke(
        main, ["compare", "--paper", "basic", "soft", "--by", "people", "--names", "{a}-{people}-{b}"]
    )
    assert done.exit_code == 0, done.output
    assert "% lower error than basic, 95 % interval" in done.output
    assert "1 run failed:\n  soft, hall-0-1, seed 1: stopped before it ended" in done.output
    assert "people = 12, 6 logs" in done.output
    whole = CliRunner().invoke(main, ["compare", ".", "--baseline", "soft"]).output
    assert "\nbasic: " in whole
    assert "% higher error than soft" in whole
    as_json = json.loads(CliRunner().invoke(main, ["compare", "basic", "soft", "--by", "log", "--json"]).output)
    (soft,) = as_json["differences"]["error_mean_m"]
    assert (soft["name"], soft["found"]["units"], soft["found"]["better"]) == ("soft", 18, "b")
    assert len(as_json["factors"][0]["levels"]) == 18
    done = CliRunner().invoke(
        main, ["report", "basic", "soft", "--names", "{a}-{people}-{b}", "--by", "people", "-o", "r.html"]
    )
    assert done.exit_code == 0, done.output
    page = Path("r.html").read_text(encoding="utf-8")
    assert "Better than basic: soft" in page
    assert 'href="basic/' in page
    assert "soft, hall-0-1, seed 1" in page
    for bad in (["report", "basic", "soft"], ["compare", "basic", "soft", "--by", "log", "--truth", "t.tum"]):
        assert CliRunner().invoke(main, bad).exit_code == 2
    bad = CliRunner().invoke(main, ["compare", "basic", "soft/hall-0-1", "--by", "people"])
    assert (bad.exit_code, "--by is for" in bad.output) == (2, True)
    for bad_words in (["-c", "wallkit.toml"], ["--set", "evaluate.lost_m=2"]):
        done = CliRunner().invoke(main, ["compare", "basic", "soft", *bad_words])
        assert (done.exit_code, "--config and --set do not change" in done.output) == (2, True)
