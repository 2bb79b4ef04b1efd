"""`evaluate --evo`: every run has zips of its own, and what is there already is not lost."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from tests.pipelines.drawn_runs import write_folder
from wallkit.cli.app import main
from wallkit.evaluate.metrics import SERIES


@pytest.fixture(autouse=True)
def logs(tmp_path, monkeypatch):
    """Two logs, of two and three seeds."""
    monkeypatch.chdir(tmp_path)
    for name, seeds in (("a", 2), ("b", 3)):
        for seed in range(seeds):
            write_folder(tmp_path / name / f"seed-{seed}", 0.05, seed=seed, log=f"{name}.mcap")
        (tmp_path / name / "run.json").write_text("{}")


def evaluate(*words, code=0):
    done = CliRunner().invoke(main, ["evaluate", *words])
    assert done.exit_code == code, done.output
    return done.output


def zips(folder):
    return sorted(path.name for path in folder.glob("*.zip"))


def test_seeds_of_several_logs_are_kept_apart(tmp_path):
    evaluate("a", "b", "--evo", "-o", "zips")
    ate = [name for name in zips(tmp_path / "zips") if name.startswith("ate-")]
    assert ate == ["ate-a-seed-0.zip", "ate-a-seed-1.zip", *(f"ate-b-seed-{n}.zip" for n in range(3))]
    # the drawn path is long enough for all but the longest steps
    assert len(zips(tmp_path / "zips")) % 5 == 0
    evaluate(str(tmp_path), "--evo", "-o", "inside")
    assert any(name.endswith("-b-seed-2.zip") for name in zips(tmp_path / "inside"))
    evaluate("a/seed-0", "--evo", "-o", "one")
    assert "ate.zip" in zips(tmp_path / "one")
    assert set(zips(tmp_path / "one")) <= {f"{name}.zip" for name in SERIES}


def test_what_is_there_is_replaced_only_when_asked_and_only_if_it_is_ours(tmp_path):
    evaluate("a", "--evo", "-o", "zips")
    before = zips(tmp_path / "zips")
    assert "--overwrite" in evaluate("b", "--evo", "-o", "zips", code=2)
    assert zips(tmp_path / "zips") == before
    evaluate("b", "--evo", "-o", "zips", "--overwrite")
    assert "ate-b-seed-2.zip" in zips(tmp_path / "zips")
    assert "ate-a-seed-0.zip" not in zips(tmp_path / "zips")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")
    assert "no result of wallkit" in evaluate("a", "--evo", "-o", "mine", "--overwrite", code=2)


def test_without_truth_nothing_is_left_behind(tmp_path):
    write_folder(tmp_path / "blind", 0.05, truth=False)
    assert "has no truth" in evaluate("blind", "--evo", "-o", "zips", code=2)
    assert not (tmp_path / "zips").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a", "-o", "zips"], "--out and --overwrite are for the zips of --evo"),
        (["a", "--evo"], "say where the zips go"),
        (["a", "a", "--evo", "-o", "zips"], "would write the same zips"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, words, said):
    assert said in evaluate(*words, code=2)
    assert not (tmp_path / "zips").exists()
