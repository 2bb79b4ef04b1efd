"""What a batch kept is what is compared: names, order, what failed and what still waits."""

import json
import re

import pytest
from click.testing import CliRunner

from tests.pipelines.batch_runs import drawn_rows
from wallkit.batch.rows import Asked, Measure, Outcome
from wallkit.batch.store import open_store
from wallkit.cli.app import main
from wallkit.errors import WallkitError
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.pipelines.batch.read import is_batch, read_runs
from wallkit.pipelines.batch.runs import DONE, FAILED, MISSING

# "soft" comes before "basic" in the alphabet's other direction, and is not the baseline
MANIFEST = '[[configurations]]\nname = "soft-first"\n[[configurations]]\nname = "basic"\n'


@pytest.fixture
def batch(tmp_path):
    """A stored batch: one run failed, one waits."""
    folder = tmp_path / "night"
    rows = [r for r in drawn_rows({"soft-first": 0.8, "basic": 1.0}) if r.seed < 2 and not r.log.startswith("lab")]
    asked = [
        Asked(
            f"{r.log}/{r.configuration}/seed-{r.seed}", r.key, "localize", f"logs/{r.log}/log.mcap", "floor.yaml", "",
            r.configuration, r.seed, "1.0", {} if r.configuration == "basic" else {"points.filters": ["soft_mask"]},
            {"log": r.log, "floor": r.log.split("-")[1]},
        )
        for r in rows
    ]  # fmt: skip
    with open_store(folder) as store:
        store.plan(asked, {"manifest": MANIFEST})
        store.add_measures(Measure(n, v.unit, v.definition, v.better) for n, v in labels_of_runs().items())
        for r in rows[2:]:
            metrics = {**r.metrics, "availability": None}
            store.add(Outcome(r.key, "done", "LOCALIZED", 0, "", metrics, seconds=9.0, cpu_s=8.0), f"runs/{r.key}")
        store.add(Outcome(rows[1].key, "failed", "", 2, "no scans on /scan\nat line 3"))
    return folder


def test_the_table_is_what_was_kept(batch):
    runs = read_runs(batch)
    assert (is_batch(batch), is_batch(batch.parent)) == (True, False)
    assert runs.configurations == ("soft-first", "basic")
    assert runs.logs[:3] == ("hall-0-1", "hall-0-2", "hall-2-1")
    assert [int((runs.status == s).sum()) for s in (DONE, FAILED, MISSING)] == [46, 1, 1]
    assert runs.facts["points.filters"][0] in ("soft_mask", "default")
    assert set(runs.facts["floor"]) == {"0", "2", "12"}
    assert set(runs.facts["map"]) == {"floor.yaml"}
    assert runs.column("error_mean_m").label.unit == "m"
    assert runs.column("availability").label.better == "higher"
    (failed,) = [i for i, status in enumerate(runs.status) if status == FAILED]
    assert (runs.messages[failed], runs.seeds[failed]) == ("no scans on /scan\nat line 3", 1)
    # runs of one log and seed are partners whatever their configuration
    for configuration in (0, 1):
        own = runs.configuration == configuration
        assert sorted(runs.pair[own]) == list(range(24))


def test_compare_and_report_read_it(batch):
    done = CliRunner().invoke(main, ["compare", str(batch), "--by", "people", "--names", "{a}-{people}-{b}"])
    assert done.exit_code == 0, done.output
    assert re.search(r"^basic: 2\d % higher error than soft-first", done.output, re.MULTILINE)
    assert "1 run failed:\n  soft-first, hall-0-1, seed 1: no scans on /scan" in done.output
    assert "1 run missing: asked for, and not run yet:\n  soft-first, hall-0-1, seed 0" in done.output
    found = json.loads(CliRunner().invoke(main, ["compare", str(batch), "--json", "--metric", "run_cpu_s"]).output)
    assert found["summaries"][0]["numbers"]["run_cpu_s"]["mean"]["value"] == pytest.approx(8.0)
    done = CliRunner().invoke(main, ["report", str(batch), "-q"])
    assert done.exit_code == 0, done.output
    assert "<h1>night</h1>" in (batch / "report.html").read_text(encoding="utf-8")


def test_one_log_on_two_maps_is_one_log_and_two_partners(tmp_path):
    with open_store(tmp_path) as store:
        store.plan(
            [
                Asked(f"hall@{m}/{c}/seed-0", f"{m}{c}", "localize", "logs/hall.mcap", f"{m}.yaml", "", c, 0, "1.0")
                for m in ("old", "new")
                for c in ("a", "b")
            ],
            {},
        )
    runs = read_runs(tmp_path)
    assert runs.logs == ("logs/hall.mcap",)
    assert sorted(zip(runs.configuration.tolist(), runs.pair.tolist(), strict=True)) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    # of a job that does not localize: how often it ended well, and every number it has
    with open_store(tmp_path) as store:
        for m in ("old", "new"):
            for c in ("a", "b"):
                store.add(Outcome(f"{m}{c}", "done", "PASS", int(c == "b" and m == "old"), "", {"places": 7.0}))
    lines = CliRunner().invoke(main, ["compare", str(tmp_path)]).output.splitlines()
    assert "mean share of runs that end well" in lines[0]
    assert [line.split()[:6] for line in lines[1:3]] == [
        ["a", "2", "0", "0", "100.0", "%"],
        ["b", "2", "0", "0", "50.0", "%"],
    ]
    assert "places" in lines[4]
    with pytest.raises(WallkitError, match="batch of wallkit"):
        read_runs(tmp_path / "gone")
