"""A sweep with a known best: what each setting does, what is worth its time, and what cannot be told from the best."""

from dataclasses import replace

import numpy as np
import pytest

from tests.pipelines.batch_runs import drawn_rows
from wallkit.pipelines.batch.compare import Question, compare_batch
from wallkit.pipelines.batch.gather import gather
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.report import batch_tables as tables
from wallkit.report import batch_words as words

COUNTS, SIGMAS = (200, 500, 2000), (0.1, 0.3)


def swept():
    """Particles help up to 500 and cost time; the second setting makes it worse by a half."""
    gains = {(n, s): (1.4 if n == 200 else 1.0) * (1.5 if s == 0.3 else 1.0) for n in COUNTS for s in SIGMAS}
    names = {f"n={n} s={s}": (n, s) for n, s in gains}
    for row in drawn_rows({name: gains[key] for name, key in names.items()}):
        count, sigma = names[row.configuration]
        settings = {"localize.count": count, "localize.sensor.sigma": sigma, "localize.seed": 7}
        yield replace(row, settings=settings, metrics={**row.metrics, "update_mean_ms": count / 100})


def told():
    return compare_batch(gather(swept(), labels_of_runs()), Question(), title="sweep")


def test_the_best_and_those_that_cannot_be_told_from_it():
    data = told()
    assert {c.name for c in data.contest.candidates if c.may_be} == {"n=500 s=0.1", "n=2000 s=0.1"}
    headers, rows = tables.candidate_table(data)
    assert headers[3:] == ["localize.count", "localize.sensor.sigma"]
    assert {tuple(row[3:]) for row in rows} == {("500", "0.1"), ("2000", "0.1")}
    assert sum(c.chance for c in data.contest.candidates) == pytest.approx(1.0)


def test_what_each_setting_does():
    effects = {e.key: e for e in told().effects}
    assert list(effects) == ["localize.sensor.sigma", "localize.count"]
    assert [(text, count) for text, count, _ in effects["localize.count"].levels] == [
        ("200", 2),
        ("500", 2),
        ("2000", 2),
    ]
    means = [mean.value for _, _, mean in effects["localize.sensor.sigma"].levels]
    assert means[1] / means[0] == pytest.approx(1.5, rel=0.02)
    # (1.5 - 1) over the middle of both
    assert effects["localize.sensor.sigma"].span_percent == pytest.approx(40, abs=2)


def test_only_what_is_not_beaten_in_both_is_on_the_front():
    data = told()
    front = {t.name for t in data.trades if t.is_front}
    assert {"n=200 s=0.1", "n=500 s=0.1"} <= front <= {"n=200 s=0.1", "n=500 s=0.1", "n=2000 s=0.1"}
    assert {t.name: t.cost for t in data.trades}["n=500 s=0.3"] == pytest.approx(5.0)


def test_a_few_drawn_values_are_grouped_too():
    numbers = {f"run-{i}": x for i, x in enumerate((0.1, 0.2, 0.5, 0.7, 0.8, 0.95))}
    rows = [
        replace(row, settings={"localize.sensor.sigma": numbers[row.configuration]})
        for row in drawn_rows({name: 1.0 + x for name, x in numbers.items()})
        if row.seed == 0 and row.log.startswith("hall")
    ]
    (effect,) = compare_batch(gather(rows, labels_of_runs()), Question(), title="random").effects
    assert [(text, count) for text, count, _ in effect.levels] == [
        ("0.1 to 0.2", 2),
        ("0.5 to 0.7", 2),
        ("0.8 to 0.95", 2),
    ]


def test_of_many_configurations_only_the_better_get_a_sentence():
    gains = {"basic": 1.0, **{f"worse-{i}": 1.5 for i in range(12)}, "same": 1.0, "better": 0.5}
    data = compare_batch(gather(drawn_rows(gains), labels_of_runs()), Question(), title="night")
    first, *others = words.difference_lines(data.differences["error_mean_m"], "error_mean_m", "basic")
    assert first.startswith("better: 50 % lower error")
    assert [line.split(":")[0] for line in others] == ["worse", "no difference can be told"]
    assert others[0].startswith("worse: 12 of 14: worse-")
    assert others[1] == "no difference can be told: 1 of 14: same"


def test_many_values_are_grouped_by_size():
    rng = np.random.default_rng(0)
    numbers = {f"run-{i}": float(x) for i, x in enumerate(np.sort(rng.uniform(0, 1, 20)))}
    rows = [
        replace(row, settings={"localize.sensor.sigma": numbers[row.configuration]})
        for row in drawn_rows({name: 1.0 + x for name, x in numbers.items()})
        if row.seed == 0 and row.log.startswith("hall")
    ]
    (effect,) = compare_batch(gather(rows, labels_of_runs()), Question(), title="sobol").effects
    assert [count for _, count, _ in effect.levels] == [4] * 5
    means = [mean.value for _, _, mean in effect.levels]
    assert means == sorted(means)
    assert effect.levels[0][0].startswith(f"{min(numbers.values()):.4g} to ")
