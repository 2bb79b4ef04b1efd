"""What is no result of localize is refused in one message, whatever command is asked about it."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from tests.pipelines.drawn_runs import write_folder
from wallkit.cli.app import main


def refused(*words):
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == 2, done.output
    assert "Traceback" not in done.output
    return done.output


@pytest.mark.parametrize("made_by", ["simulate log", "wallkit simulate log"])
@pytest.mark.parametrize("command", ["evaluate", "report", "compare"])
def test_folders_of_other_commands_are_no_runs(tmp_path, command, made_by):
    sim = tmp_path / "sim"
    sim.mkdir()
    (sim / "run.json").write_text(json.dumps({"schema": 1, "command": made_by, "seed": 0}))
    words = [command, sim, sim] if command == "compare" else [command, sim]
    assert f"{sim}: no result of wallkit localize: run.json is of wallkit simulate log\n  hint: " in refused(*words)


def test_the_folder_of_a_demo_names_what_is_in_it(tmp_path):
    write_folder(tmp_path / "demo" / "basic", 0.05)
    (tmp_path / "demo" / "run.json").write_text('{"schema": 2, "methods": {}}')
    assert "no result of wallkit localize\n  hint: name one of basic in it" in refused("evaluate", tmp_path / "demo")


def test_a_run_json_that_is_no_object_is_told(tmp_path):
    (tmp_path / "run.json").write_text("[]")
    assert "run.json: is list in JSON, where an object is wanted" in refused("evaluate", tmp_path)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--t-offset", "nan"), "Invalid value for '--t-offset': nan is no finite number"),
        (("--t-offset", "1e300"), "'evaluate.truth_offset_s' is"),
        (("--set", "evaluate.truth_offset_s=nan"), "'evaluate.truth_offset_s' is"),
    ],
)
def test_an_offset_that_is_no_time_is_told(tmp_path, words, said):
    assert said in refused("evaluate", write_folder(tmp_path / "a", 0.05), *words)


def test_a_folder_called_like_a_seed_is_told(tmp_path):
    for name in ("seed-0", "seed-old"):
        write_folder(tmp_path / "a" / name, 0.05)
    (tmp_path / "a" / "run.json").write_text("{}")
    assert f"{tmp_path / 'a'}: 'seed-old' is not the folder of a seed" in refused("evaluate", tmp_path / "a")


def test_what_other_commands_left_beside_results_is_passed_over(tmp_path):
    for name in ("hall", "lab"):
        write_folder(tmp_path / "basic" / name, 0.05)
        write_folder(tmp_path / "soft" / name, 0.06)
    (tmp_path / "basic" / "sim").mkdir()
    (tmp_path / "basic" / "sim" / "run.json").write_text('{"command": "simulate log"}')
    done = CliRunner().invoke(main, ["evaluate", str(tmp_path / "basic")])
    assert (done.exit_code, "over 2 runs" in done.output) == (0, True)
    done = CliRunner().invoke(main, ["compare", str(tmp_path / "basic"), str(tmp_path / "soft")])
    assert (done.exit_code, "stopped before it ended" in done.output) == (0, False), done.output
