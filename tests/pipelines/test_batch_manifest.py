"""Manifests: what they ask for, in words and in files, and what is wrong with them."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wallkit.errors import ConfigError
from wallkit.pipelines.batch.expand import Sweep, expanded
from wallkit.pipelines.batch.files import digest, find_logs, short_names
from wallkit.pipelines.batch.manifest import read_manifest
from wallkit.pipelines.batch.plan import PIECE, plan_of

TWO = '[[configurations]]\nname = "a"\n[[configurations]]\nname = "b"\nsettings = {"localize.particles" = 300}\n'


@pytest.fixture
def folder(tmp_path):
    for place in ("hall", "lab"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "log.mcap").write_bytes(place.encode())
    (tmp_path / "floor.yaml").write_text("a map")
    return tmp_path


def planned(folder: Path, text: str, known=None):
    path = folder / "m.toml"
    path.write_text(text)
    return plan_of(read_manifest(path), folder / "out", {} if known is None else known)


def first(folder: Path, text: str, known):
    return next(planned(folder, text, known).asked())


def test_every_log_with_every_configuration_and_seed(folder):
    plan = planned(folder, 'logs = ["*/log.mcap"]\nmaps = ["floor.yaml"]\nseeds = [3, 4]\n' + TWO)
    asked = list(plan.asked())
    names = [run.name for run in asked]
    assert names == [f"{log}/{c}/seed-{s}" for log in ("hall", "lab") for c in "ab" for s in (3, 4)]
    assert {run.map for run in asked} == {"floor.yaml"}
    assert asked[2].settings == {"localize.particles": 300}
    assert len({run.key for run in asked}) == len(names) == len(plan)
    pieces = list(plan.pieces(lambda key: True))
    assert [[task.name for task in piece] for piece in pieces] == [names[:4], names[4:]]
    many = planned(folder, f'logs = ["hall"]\nseeds = {list(range(40))}')
    assert [len(piece) for piece in many.pieces(lambda key: True)] == [PIECE, PIECE, 40 - 2 * PIECE]


@pytest.mark.parametrize("word", ["logs", "logs/*/log.mcap", "logs/**/*.mcap", "logs/*"])
def test_what_is_still_being_written_is_no_log_yet(tmp_path, word):
    """Commands write into .NAME.partial-PID; who names it gets it."""
    for name in ("a", ".b.partial-7"):
        (tmp_path / "logs" / name).mkdir(parents=True)
        (tmp_path / "logs" / name / "log.mcap").write_bytes(b"")
    assert find_logs([word], tmp_path, where="batch.toml") == [str(tmp_path / "logs/a/log.mcap")]
    assert find_logs(["logs/.b*/log.mcap"], tmp_path, where="batch.toml") == [
        str(tmp_path / "logs/.b.partial-7/log.mcap")
    ]


def test_the_key_is_of_contents_and_not_of_places(folder):
    text = 'logs = ["hall/log.mcap"]\nmaps = ["floor.yaml"]\n[settings.localize]\nparticles = 300\n'
    known = {}
    before = first(folder, text, known)
    assert first(folder, text, known) == before
    (folder / "floor.yaml").rename(folder / "other.yaml")
    (folder / "hall").rename(folder / "corridor")
    moved = text.replace("floor.yaml", "other.yaml").replace("hall", "corridor")
    assert first(folder, moved, known).key == before.key
    assert first(folder, moved.replace("300", "301"), known).key != before.key
    assert first(folder, "end_s = 5\n" + moved, known).key != before.key
    (folder / "other.yaml").write_text("another map")
    assert first(folder, moved, known).key != before.key


@pytest.mark.parametrize("words", ['model = "default"\n', '[settings.segment]\nmodel = "default"\n'])
def test_another_default_model_is_another_input(folder, words, monkeypatch):
    text = 'logs = ["hall/log.mcap"]\nmaps = ["floor.yaml"]\n' + words
    before = first(folder, text, {})
    (folder / "newer.onnx").write_bytes(b"a model")
    monkeypatch.setattr("wallkit.segment.default._FILE", folder / "newer.onnx")
    assert first(folder, text, {}).key != before.key


def test_memory_does_not_grow_with_the_number_of_runs(folder):
    def peak(seeds: int) -> int:
        plan = planned(folder, f'logs = ["hall"]\nseeds = {list(range(seeds))}')
        tracemalloc.start()
        done = sum(len(piece) for piece in plan.pieces(lambda key: True)) + sum(1 for _ in plan.asked())
        assert done == 2 * seeds
        _, found = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return found

    peak(20)
    assert peak(2000) < peak(200) + 20_000


def test_copies_of_a_log_and_two_names_of_one_setting_are_runs_of_their_own(folder):
    (folder / "lab" / "log.mcap").write_bytes((folder / "hall" / "log.mcap").read_bytes())
    plan = planned(folder, 'logs = ["hall", "lab"]\n' + TWO.replace('settings = {"localize.particles" = 300}\n', ""))
    assert len({run.key for run in plan.asked()}) == len(plan) == 4


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('logs = ["*.bag"]', r"'\*.bag' matches nothing"),
        ('logs = ["hall"]\nmaps = ["roof.yaml"]', "there is no map 'roof.yaml'"),
        ('logs = ["hall"]\n' + TWO.replace('"b"', '"a"'), "two configurations are named 'a'"),
        ('logs = ["hall"]\n' + TWO.replace("particles", "particels"), "no setting 'particels'"),
        ('logs = ["hall"]\nsteps = 5', "no setting 'steps'"),
        ("seeds = [1]", "names no logs"),
        ('logs = ["hall"]\nseeds = [1, 1]', "names a seed twice"),
        ('logs = ["hall"]\njob = "map audit"', "map audit needs a map"),
        ('logs = ["hall"]\n[sweep.over]\n"localize.particles" = 5', "no list and no range"),
        ('logs = ["hall"]\n[sweep.over]\n"localize.particles" = {low = 1, high = 2}', "as a list"),
    ],
)
def test_what_is_wrong_is_said_before_anything_runs(folder, text, said):
    with pytest.raises(ConfigError, match=said) as caught:
        planned(folder, text)
    assert caught.value.where
    assert caught.value.hint


def test_a_map_beside_each_log_may_be_missing_for_one(folder):
    (folder / "hall" / "map.yaml").write_text("a map")
    plan = planned(folder, 'logs = ["hall", "lab"]\nmaps = ["beside:map.yaml"]')
    assert [run.map for run in plan.asked()] == ["hall/map.yaml", "lab/map.yaml"]


def test_folders_are_searched_and_bags_are_one_log(folder):
    (folder / "lab" / "metadata.yaml").write_text("")
    assert find_logs(["."], folder, where="") == [str(folder / "hall" / "log.mcap"), str(folder / "lab")]
    assert find_logs(["hall/log.mcap", "*/log.mcap"], folder, where="")[0] == str(folder / "hall" / "log.mcap")


def test_short_names_tell_apart():
    assert short_names(["/x/a.mcap", "/x/b.mcap"]) == ["a", "b"]
    assert short_names(["/a/log.mcap", "/b/log.mcap"]) == ["a", "b"]
    assert short_names(["/a/1.bag", "/a/2.bag", "/b/1.bag"]) == ["a-1", "a-2", "b-1"]


def test_a_digest_is_remembered_until_the_file_changes(folder):
    path, known = folder / "floor.yaml", {}
    first = digest(path, known)
    size, stamp, _ = known[str(path)]
    known[str(path)] = (size, stamp, "remembered")
    assert digest(path, known) == "remembered"
    path.write_text("longer than before")
    assert digest(path, known) not in (first, "remembered")


def test_a_grid_is_all_combinations_and_names_configurations(folder):
    text = 'logs = ["hall"]\n[sweep.over]\n"localize.particles" = [100, 200]\n'
    text += 'localize.sensor = ["beam", "likelihood_field"]\n'
    read = read_manifest(_written(folder, text))
    assert [c.flat for c in read.configurations] == [
        {"localize.particles": n, "localize.sensor": s} for n in (100, 200) for s in ("beam", "likelihood_field")
    ]
    assert read.swept == ("localize.particles", "localize.sensor")
    named = read_manifest(_written(folder, text.replace("[sweep", TWO + "[sweep")))
    assert len(named.configurations) == 8
    assert named.configurations[0].name == "a-sweep-00"


def test_sobol_fills_every_cell_and_random_stays_in_range():
    over = {"x": {"low": 0, "high": 8}, "n": {"low": 1, "high": 8, "integer": True}, "k": ["p", "q"]}
    sweep = Sweep("sobol", 64, 1)
    points = expanded(sweep, over, where="")
    assert points == expanded(sweep, over, where="")
    # a scrambled Sobol sequence of 64 has exactly 8 points in each eighth of every axis
    assert np.histogram([p["x"] for p in points], 8, (0, 8))[0].tolist() == [8] * 8
    assert sorted({p["n"] for p in points}) == list(range(1, 9))
    assert [p["k"] for p in points].count("p") == 32
    logarithmic = expanded(replace(sweep, kind="random"), {"x": {"low": 0.01, "high": 100, "log": True}}, where="")
    assert 0.25 < np.mean([p["x"] < 1 for p in logarithmic]) < 0.75


def _written(folder: Path, text: str) -> Path:
    (folder / "m.toml").write_text(text)
    return folder / "m.toml"
