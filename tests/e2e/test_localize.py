"""`wallkit localize` and what comes after it, on the sample inside the package."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import wallkit.sample

SAMPLE = Path(wallkit.sample.__file__).parent
LOG, MAP = SAMPLE / "log.mcap", SAMPLE / "map.yaml"
FILES = {
    "estimate.tum",
    "odometry.tum",
    "truth.tum",
    "steps.csv",
    "snapshots.npz",
    "metrics.json",
    "run.json",
    "result.mcap",
    "foxglove-layout.json",
    "report.html",
}


def test_a_run_says_five_things_and_leaves_a_folder(wallkit, tmp_path):
    done = wallkit("localize", LOG, "--map", MAP)
    assert done.code == 0
    # a first run compiles, which takes long enough for progress to be shown
    assert all(line.startswith("scans: ") for line in done.err.splitlines())
    assert [line.split()[0] for line in done.out.splitlines() if line] == [
        "where",
        "sure",
        "wrong",
        "fast",
        "dropped",
        "report",
    ]
    assert {path.name for path in (tmp_path / "log.wallkit").iterdir()} == FILES
    metrics = json.loads((tmp_path / "log.wallkit" / "metrics.json").read_text())
    assert metrics["schema"] == 1
    assert metrics["health"] == "LOCALIZED"
    assert metrics["false_healthy"] == 0
    assert metrics["modes"][0]["share"] > 0.9
    run = json.loads((tmp_path / "log.wallkit" / "run.json").read_text())
    assert {entry["path"] for entry in run["inputs"]} == {str(LOG), str(MAP)}
    assert run["seed"] == 0
    assert run["origins"]["localize.particles"] == "default"


def test_same_seed_same_bytes_and_another_seed_others(wallkit, tmp_path):
    outs = {}
    for name, words in (("a", ()), ("b", ("--set", "localize.threads=2")), ("c", ("--seed", "1"))):
        assert wallkit("localize", LOG, "--map", MAP, "-o", name, "-q", *words).code == 0
        outs[name] = {n: (tmp_path / name / n).read_bytes() for n in ("estimate.tum", "result.mcap")}
    assert outs["a"] == outs["b"]
    assert outs["a"]["estimate.tum"] != outs["c"]["estimate.tum"]


def test_json_is_one_document_and_streams_are_poses(wallkit):
    document = wallkit("localize", LOG, "--map", MAP, "--json", "-q").json
    assert document["schema"] == 1
    assert document["ate_rmse_m"] >= 0
    tum = wallkit("localize", LOG, "--map", MAP, "--init", "truth", "-o", "-", "--format", "tum", "-q")
    assert all(len(line.split()) == 8 for line in tum.out.splitlines() if not line.startswith("#"))
    rows = wallkit(
        "localize", LOG, "--map", MAP, "--init", "truth", "-o", "-", "--format", "ndjson", "-q"
    ).out.splitlines()
    assert set(json.loads(rows[-1])) >= {"stamp_ns", "x_m", "y_m", "yaw_rad", "health"}


def test_results_are_not_overwritten_unasked(wallkit, tmp_path):
    assert wallkit("localize", LOG, "--map", MAP, "-o", "out", "-q").code == 0
    before = (tmp_path / "out" / "estimate.tum").read_bytes()
    again = wallkit("localize", LOG, "--map", MAP, "-o", "out", "-q", "--seed", "5")
    assert again.code == 2
    assert "--overwrite" in again.err
    assert (tmp_path / "out" / "estimate.tum").read_bytes() == before
    assert wallkit("localize", LOG, "--map", MAP, "-o", "out", "-q", "--seed", "5", "--overwrite").code == 0
    assert (tmp_path / "out" / "estimate.tum").read_bytes() != before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("years of work")
    assert wallkit("localize", LOG, "--map", MAP, "-o", "mine", "-q", "--overwrite").code == 2
    assert (tmp_path / "mine" / "thesis.tex").exists()


def test_dry_run_checks_all_and_writes_nothing(wallkit, tmp_path):
    done = wallkit("localize", LOG, "--map", MAP, "--dry-run")
    assert done.code == 0
    assert "nothing is written" in done.out
    assert list(tmp_path.iterdir()) == []


def test_seeds_give_mean_sd_and_worst(wallkit, tmp_path):
    done = wallkit("localize", LOG, "--map", MAP, "--seeds", "3", "-o", "three", "-q")
    assert done.code == 0
    assert "3 of 3 seeds end LOCALIZED" in done.out
    summary = json.loads((tmp_path / "three" / "metrics.json").read_text())
    assert summary["seeds"] == [0, 1, 2]
    assert summary["metrics"]["ate_rmse_m"]["runs"] == 3
    table = wallkit("evaluate", "three")
    assert table.code == 0
    assert "ate_rmse_m" in table.out
    compared = wallkit("compare", "three", "three", "--json").json
    assert compared["differences"] == [] or all(d["better"] == "neither" for d in compared["differences"])


def test_evaluate_report_and_compare_read_a_folder_again(wallkit, tmp_path):
    for name, sensor in (("basic", "likelihood_field"), ("known", "class_conditional")):
        assert wallkit("localize", LOG, "--map", MAP, "-o", name, "-q", "--set", f"localize.sensor={sensor}").code == 0
    metrics = wallkit("evaluate", "basic", "--json").json["metrics"]
    stored = json.loads((tmp_path / "basic" / "metrics.json").read_text())
    assert metrics["ate_rmse_m"] == pytest.approx(stored["ate_rmse_m"], abs=1e-9)
    assert wallkit("evaluate", "basic", "--max-ate-m", "100").code == 0
    bad = wallkit("evaluate", "basic", "--max-ate-m", "0.001")
    assert (bad.code, "is above" in bad.err) == (1, True)
    assert wallkit("report", "basic", "-o", "again.html").code == 0
    assert (tmp_path / "again.html").stat().st_size > 100_000
    done = wallkit("compare", "basic", "known", "-o", "compare.html")
    assert done.code == 0
    assert "error_mean_m" in done.out
    assert (tmp_path / "compare.html").is_file()
    # a folder of result folders is one configuration over several logs
    for name in ("basic", "known"):
        shutil.copytree(tmp_path / name, tmp_path / "pool" / name)
    table = wallkit("compare", "--paper", "pool", "known").out.splitlines()
    assert [line.split()[:2] for line in table[1:3]] == [["pool", "2"], ["known", "1"]]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["localize", "gone.mcap", "--map", MAP], "gone.mcap"),
        (["localize", LOG], "no map was given"),
        (["localize", LOG, "--map", "gone.yaml"], "gone.yaml"),
        (["localize", LOG, "--map", MAP, "--init", "here"], "'here' is no start"),
        (["localize", LOG, "--map", MAP, "--init", "topic"], "no initial pose topic"),
        (["localize", LOG, "--map", MAP, "--init", "1,2,nan"], "is no start"),
        (["localize", LOG, "--map", MAP, "--init", "100,100,0"], "outside the map"),
        (["localize", LOG, "--map", MAP, "--scan", "/lidar"], "/lidar"),
        (["localize", LOG, "--map", MAP, "--set", "localize.particels=3"], "particles"),
        (["localize", LOG, "--map", MAP, "--set", "localize.particles=0"], "at least 1"),
        (["localize", LOG, "--map", MAP, "--set", "localize.tracker=ekf"], "start"),
        (["localize", LOG, "--map", MAP, "--start", "1000"], "sweep"),
        (["localize", LOG, "--map", MAP, "--format", "tum"], "--out -"),
        (["localize"], "Missing argument"),
        (["evaluate", "."], "run.json is missing"),
        (["compare", "."], "run.json is missing"),
        (["log", "info", MAP], "map.yaml"),
        (["log", "convert", LOG], "-o new.mcap"),
        (["lokalize"], "No such command"),
    ],
)
def test_bad_input_is_one_message_and_exit_2(wallkit, tmp_path, words, message):
    done = wallkit(*words)
    assert done.code == 2
    assert message in done.err
    assert "Traceback" not in done.err
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_fails_in_the_middle_leaves_nothing(wallkit, tmp_path):
    """The map's image vanishes between the check and the run only in a test; a log cut to nothing does the same."""
    broken = tmp_path / "cut.mcap"
    broken.write_bytes(LOG.read_bytes()[:4000])
    done = wallkit("localize", broken, "--map", MAP, "-q")
    assert done.code in (2, 3, 4)
    leftovers = [p.name for p in tmp_path.iterdir() if p.name != "cut.mcap"]
    assert leftovers == ([] if done.code == 2 else ["cut.wallkit"])


def test_settings_come_from_file_words_and_flags_in_this_order(wallkit, tmp_path):
    shutil.copy(MAP, tmp_path / "floor.yaml")
    shutil.copy(SAMPLE / "map.pgm", tmp_path / "map.pgm")
    (tmp_path / "wallkit.toml").write_text(
        'map = "floor.yaml"\n[localize]\nparticles = 300\n[localize.sensor]\nname = "beam"\n'
    )
    done = wallkit("localize", LOG, "--init", "truth", "-q", "--set", "localize.particles=400", "--particles", "500")
    assert done.code in (0, 4)
    run = json.loads((tmp_path / "log.wallkit" / "run.json").read_text())
    assert run["config"]["localize"]["particles"] == 500
    assert run["origins"]["localize.particles"] == "--particles"
    assert run["config"]["localize"]["sensor"]["name"] == "beam"
    assert run["origins"]["localize.sensor.name"] == "wallkit.toml:5"
    assert wallkit("config", "check").code == 0
    (tmp_path / "wallkit.toml").write_text("[localize]\nparticels = 3\n")
    bad = wallkit("config", "check")
    assert bad.code == 1
    assert "wallkit.toml:2" in bad.out
    assert "did you mean 'particles'" in bad.out


def test_log_info_and_convert(wallkit, tmp_path):
    info = wallkit("log", "info", LOG)
    assert info.code == 0
    assert "can be localized, given a map" in info.out
    document = wallkit("log", "info", LOG, "--json").json
    assert document["can_localize"] is True
    assert wallkit("log", "convert", LOG, "-o", "copy.mcap").code == 0
    assert wallkit("log", "convert", LOG, "-o", "copy.mcap").code == 2
    a = wallkit("localize", LOG, "--map", MAP, "-o", "a", "-q")
    b = wallkit("localize", "copy.mcap", "--map", MAP, "-o", "b", "-q")
    assert (a.code, b.code) == (0, 0)
    assert (tmp_path / "a" / "estimate.tum").read_bytes() == (tmp_path / "b" / "estimate.tum").read_bytes()


def test_demo_is_as_expected(wallkit_from_nothing, tmp_path):
    done = wallkit_from_nothing("demo", "--json", "-q")
    assert done.code == 0, done.out
    assert done.json["surprises"] == []
    assert done.json["map"] == "good: 0 errors, 0 warnings"
    assert done.json["calibration"] == "PASS"
    kept = {name: seeds[0]["kept_share"] for name, seeds in done.json["methods"].items() if "kept_share" in seeds[0]}
    assert set(kept) == {"novelty", "wall_mask", "wall_mask, true masks", "soft_mask"}
    assert all(0.9 < share < 1 for share in kept.values())
    page = (tmp_path / "wallkit-demo" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/jpeg") == 3
    assert done.json["conclusion"][0].split(":")[0] in page
    assert wallkit_from_nothing("demo", "-q").code == 2


def test_doctor_and_completion(wallkit):
    assert wallkit("doctor").code == 0
    assert "wallkit" in wallkit("completion", "bash").out
