"""Runs side by side: only those of one log, seed with seed, and what is left out is said."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from tests.pipelines.drawn_runs import judged, write_folder
from wallkit.cli.app import main
from wallkit.errors import WallkitError
from wallkit.pipelines.evaluate import EvaluateSettings
from wallkit.pipelines.report import compare_runs
from wallkit.report.html import compare_html


def several(error_m, seeds, **options):
    """Errors that grow with the seed, by the same step in every configuration."""
    return [judged(error_m + 0.001 * seed, seed=seed, **options) for seed in seeds]


def compared(a, b):
    return compare_runs([a, b], ["one", "two"], EvaluateSettings(), seed=0)


def test_runs_of_different_logs_have_no_winner():
    here, there = judged(0.05, log="a/log.mcap"), judged(0.10, log="b/log.mcap", digest="b" * 64)
    with pytest.raises(WallkitError, match="different logs") as error:
        compared([here], [there])
    assert "one and two: " in str(error.value)
    assert "a/log.mcap (sha256 aaaaaaaa...), and b/log.mcap (sha256 bbbbbbbb...)" in str(error.value)
    assert "wallkit compare basic/" in error.value.hint
    with pytest.raises(WallkitError, match="different logs"):
        compared([here, judged(0.1, log="b/log.mcap", digest="b" * 64, seed=1)], [here])


def test_a_copy_of_the_log_is_the_same_log_and_names_count_where_a_run_has_no_hash():
    assert compared([judged(0.05)], [judged(0.10, log="copies/renamed.mcap")]).differences
    assert compared([judged(0.05, digest=None)], [judged(0.10, log="elsewhere/hall.mcap")]).differences
    with pytest.raises(WallkitError, match="different logs"):
        compared([judged(0.05, digest=None)], [judged(0.10, log="logs/lab.mcap")])


def test_a_log_that_is_a_folder_is_known_by_its_files():
    of_folder, other = judged(0.05, log="bag"), judged(0.05, log="copy", digest="c" * 64)
    for (record, _), name in ((of_folder, "bag"), (other, "copy")):
        record.run["inputs"][0]["path"] = f"{name}/bag_0.db3"
    with pytest.raises(WallkitError, match="different logs"):
        compared([of_folder], [other])


def test_a_calibration_in_the_folder_of_the_log_makes_no_other_log():
    """The run that looked through the camera names it twice: as a file of the folder, and as a calibration."""
    calibration = {"path": "bag/front.toml", "bytes": 1, "sha256": "c" * 64}
    without, with_camera = judged(0.05, log="bag"), judged(0.06, log="bag")
    for record, _ in (without, with_camera):
        record.run["inputs"][0]["path"] = "bag/bag_0.db3"
        record.run["inputs"].append(calibration)
    with_camera[0].run["inputs"].append(calibration)
    assert compared([without], [with_camera]).differences


def test_seeds_are_paired_by_their_number_not_by_their_place():
    data = compared(several(0.05, (0, 1, 2, 3)), several(0.06, (3, 2, 1, 7)))
    found = {c.key: c for _, _, c in data.differences}
    assert found["ate_rmse_m"].pairs == 3
    # seed by seed the difference is the same: paired by place it would be another
    assert found["ate_rmse_m"].difference == pytest.approx(0.01, abs=1e-6)
    assert data.notes == (
        "seed 0 of one has no partner and is left out of the tests",
        "seed 7 of two has no partner and is left out of the tests",
    )
    assert "seed 7 of two has no partner" in compare_html(data)


def test_without_a_common_seed_nothing_is_tested_and_that_is_said():
    data = compared(several(0.05, (0, 1, 2)), several(0.06, (50, 51, 52)))
    assert data.differences == ()
    (note,) = data.notes
    assert note.startswith("one has seeds 0, 1, 2, two has seeds 50, 51, 52, none in common, so nothing is tested")


def test_one_common_seed_is_compared_over_its_scans_and_that_is_said():
    data = compared(several(0.05, (0, 1, 2)), several(0.06, (2,)))
    ((_, _, found),) = data.differences
    assert (found.key, found.pairs, found.difference) == ("error_mean_m", 60, pytest.approx(0.01, abs=1e-6))
    assert data.notes == (
        "seeds 0, 1 of one have no partner and are left out of the tests",
        "one and two have seed 2 alone in common, whose scans are compared",
    )
    assert compared([judged(0.05)], [judged(0.06, seed=5)]).notes == ("seed 0 of one is held against seed 5 of two",)


def test_a_number_that_only_some_seeds_have_is_not_tested_and_that_is_said():
    data = compare_runs(
        [several(0.05, (0, 1)), [judged(0.05), judged(3.0, seed=1)]], ["one", "two"], EvaluateSettings(), seed=0,
        keys=("error_mean_m", "updates_to_converge"),
    )  # fmt: skip
    assert [c.key for _, _, c in data.differences] == ["error_mean_m"]
    assert data.notes == ("updates_to_converge of one and two is not tested: 1 of 4 runs have none",)


def test_the_command_refuses_and_says_what_it_left_out(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_folder(tmp_path / "hall", 0.05)
    write_folder(tmp_path / "lab", 0.10, log="lab.mcap", digest="b" * 64)
    done = CliRunner().invoke(main, ["compare", "hall", "lab"])
    assert (done.exit_code, "hall and lab: runs of different logs cannot be compared" in done.output) == (2, True)
    for seed in (0, 1, 2):
        write_folder(tmp_path / "a" / f"seed-{seed}", 0.05, seed=seed)
        write_folder(tmp_path / "b" / f"seed-{seed + 1}", 0.06, seed=seed + 1)
        for name in "ab":
            (tmp_path / name / "run.json").write_text("{}")
    said = CliRunner().invoke(main, ["compare", "a", "b"]).output
    assert "note: seed 0 of a has no partner" in said
    notes = json.loads(CliRunner().invoke(main, ["compare", "a", "b", "--json"]).output)["notes"]
    assert notes == [f"seed {s} of {n} has no partner and is left out of the tests" for n, s in (("a", 0), ("b", 3))]
