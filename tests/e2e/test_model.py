"""`wallkit model` as a user runs it; most of it in this process, since starting Python costs more than the models here."""

from __future__ import annotations

import subprocess
import sys

import cv2
import pytest

from tests.e2e.conftest import Done
from tests.segment.altered import altered_oracle
from tests.segment.drawn import picture
from wallkit.cli.app import main


@pytest.fixture
def wallkit(tmp_path, monkeypatch, capsys):
    """Runs `wallkit WORDS...` in a folder of its own and in this process."""
    monkeypatch.chdir(tmp_path)

    def run(*words: object) -> Done:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words], prog_name="wallkit")
        said = capsys.readouterr()
        return Done(int(ended.value.code or 0), said.out, said.err)

    return run


@pytest.fixture
def oracle(wallkit, tmp_path):
    assert wallkit("model", "fixture", "oracle.onnx", "--imgsz", "192x320").code == 0
    return tmp_path / "oracle.onnx"


def test_inspect_names_layout_and_roles_and_judges_them(wallkit, oracle):
    done = wallkit("model", "inspect", oracle, "--require", "wall,door", "--json")
    assert done.code == 0
    assert done.json["layout"] == "yolo-anchors"
    assert done.json["input_size_px"] == [192, 320]
    assert done.json["classes"][1] == {"id": 1, "name": "door", "role": "door"}
    done = wallkit("model", "inspect", oracle, "--require", "wall,floor")
    assert (done.code, "no class counts as floor" in done.out) == (1, True)
    done = wallkit("model", "inspect", oracle, "--require", "wal")
    assert (done.code, "did you mean 'wall'" in done.err) == (2, True)


def test_inspect_refuses_what_is_no_model(wallkit, tmp_path):
    (tmp_path / "page.onnx").write_text("<html>")
    done = wallkit("model", "inspect", "page.onnx")
    assert done.code == 2
    assert "page.onnx: onnxruntime cannot load it" in done.err
    assert "Traceback" not in done.err


def test_fixture_takes_colours_and_keeps_what_is_there(wallkit, tmp_path, oracle):
    (tmp_path / "colours.toml").write_text("wall = [200, 180, 160]\nrobot = [10, 20, 200]\n")
    assert wallkit("model", "fixture", oracle).code == 2
    assert (
        wallkit("model", "fixture", oracle, "--overwrite", "--classes", "colours.toml", "--layout", "class-ids").code
        == 0
    )
    found = wallkit("model", "inspect", oracle, "--json").json
    assert [one["name"] for one in found["classes"]] == ["wall", "robot"]
    assert found["layout"] == "class-ids"
    (tmp_path / "colours.toml").write_text("wall = [200, 180, 160]\ndoor = [199, 180, 160]\n")
    done = wallkit("model", "fixture", "b.onnx", "--classes", "colours.toml")
    assert (done.code, "too near each other" in done.err) == (2, True)
    (tmp_path / "colours.toml").write_text("wall = 'grey'\n")
    done = wallkit("model", "fixture", "b.onnx", "--classes", "colours.toml")
    assert (done.code, "colours.toml:1: 'wall' is 'grey', no colour" in done.err) == (2, True)
    assert not (tmp_path / "b.onnx").exists()


@pytest.fixture
def pictures(tmp_path):
    folder = tmp_path / "pictures"
    folder.mkdir()
    for k in range(2):
        things = {"wall": (20 + 30 * k, 40, 300, 170), "person": (100, 60, 150, 180)}
        cv2.imwrite(str(folder / f"{k}.png"), picture((180, 320), things)[..., ::-1])
    return folder


def test_verify_agrees_differs_with_a_cause_or_cannot_tell(wallkit, tmp_path, oracle, pictures):
    done = wallkit("model", "verify", oracle, oracle, "--images", pictures, "--json")
    assert (done.code, done.json["verdict"], done.json["things_a"], done.json["match_share"]) == (0, "agree", 4, 1.0)
    altered_oracle(tmp_path / "b.onnx", "bgr", (192, 320))
    done = wallkit("model", "verify", oracle, "b.onnx", "--images", pictures)
    assert done.code == 1
    assert "because  B (b.onnx) takes blue, green, red (BGR) instead of RGB" in done.out
    assert "verdict  differ: 50% of the things are matched, 95% were asked" in done.out
    cv2.imwrite(str(tmp_path / "empty.png"), picture((180, 320), {}))
    done = wallkit("model", "verify", oracle, oracle, "--images", "empty.png")
    assert (done.code, "cannot tell: neither finds anything" in done.out) == (4, True)
    (tmp_path / "broken.png").write_bytes(b"\x89PNG broken")
    done = wallkit("model", "verify", oracle, oracle, "--images", "broken.png")
    assert (done.code, "broken.png" in done.err, "Traceback" in done.err) == (2, True, False)


def test_bench_splits_the_time_and_judges_it(wallkit, oracle, pictures):
    words = ("model", "bench", oracle, "--images", pictures, "--rounds", "3", "--json")
    done = wallkit(*words, "--threads", "1,2", "--spin", "off,on", "--rate", "0.1")
    assert done.code == 0, done.err
    rows = done.json["rows"]
    assert [(row["threads"], row["spinning"]) for row in rows] == [(1, False), (2, False), (2, True)]
    for row in rows:
        cpu = row["cpu_ms"]
        assert all(value > 0 for value in cpu.values())
        assert row["beside_cpu_ms"] == pytest.approx(cpu["prepare"] + cpu["read"] + cpu["points"])
        assert row["total_cpu_ms"] == pytest.approx(row["beside_cpu_ms"] + cpu["network"])
    done = wallkit(*words, "--rate", "1000000")
    assert (done.code, done.json["rows"][0]["verdict"]) == (1, "too slow")


def test_bench_of_a_fixed_size_cannot_take_another(wallkit, oracle):
    done = wallkit("model", "bench", oracle, "--sizes", "320")
    assert (done.code, "its input is 192 x 320, not 320 x 320" in done.err) == (2, True)


def test_quantize_writes_what_still_sees_and_nothing_else(wallkit, tmp_path, pictures):
    assert wallkit("model", "fixture", "stuff.onnx", "--imgsz", "192x320", "--layout", "class-scores").code == 0
    words = ("model", "quantize", "stuff.onnx", "--images", pictures)
    assert "would calibrate and judge with 2 pictures and write stuff-int8.onnx" in wallkit(*words, "--dry-run").out
    done = wallkit("model", "quantize", "nofile.onnx", "--images", pictures, "--dry-run")
    assert (done.code, "nofile.onnx" in done.err, done.out) == (2, True, "")
    done = wallkit(*words, "--json")
    assert done.code == 0, done.err
    assert (done.json["written"], done.json["judged_by_calibration_pictures"], done.json["match_share"]) == (
        True,
        True,
        1.0,
    )
    assert wallkit("model", "inspect", "stuff-int8.onnx", "--json").json["is_quantised"]
    assert wallkit(*words).code == 2
    cv2.imwrite(str(tmp_path / "empty.png"), picture((180, 320), {}))
    done = wallkit("model", "quantize", "stuff.onnx", "--images", "empty.png", "-o", "other.onnx")
    assert (done.code, "so nobody can judge" in done.err) == (2, True)
    assert not (tmp_path / "other.onnx").exists()


def test_export_prints_the_set_up_and_says_what_it_lacks(wallkit, tmp_path):
    done = wallkit("model", "export", "--print-setup")
    assert done.code == 0
    assert "pip install --no-deps ultralytics==" in done.out
    done = wallkit("model", "export")
    assert (done.code, "BEST.pt" in done.err) == (2, True)
    (tmp_path / "best.pt").write_bytes(b"weights")
    done = wallkit("model", "export", "best.pt", "--imgsz", "300")
    assert (done.code, "the exporter would round it silently" in done.err) == (2, True)
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'ultralytics'\" >&2\nexit 1\n")
    python.chmod(0o755)
    done = wallkit("model", "export", "best.pt", "--python", python, "--dry-run")
    assert (done.code, f"would run {python} and write best.onnx (320x320)" in done.out) == (0, True)
    done = wallkit("model", "export", "best.pt", "--python", python)
    assert (done.code, "has no Ultralytics" in done.err) == (2, True)
    assert not (tmp_path / "best.onnx").exists()


def test_the_command_itself_runs(tmp_path):
    command = [sys.executable, "-c", "from wallkit.cli.app import main; main()", "model", "fixture", "oracle.onnx"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("wrote oracle.onnx, 4.8 kB: yolo-anchors, 320 x 320 px\n  wall ")


def test_the_model_of_the_package_is_called_default(wallkit, pictures):
    done = wallkit("model", "inspect", "default", "--require", "wall,door,person", "--json")
    assert (done.code, done.json["licence"]) == (0, "Apache-2.0")
    done = wallkit("model", "bench", "default", "--images", pictures, "--rounds", "2", "--rate", "0.1", "--json")
    assert (done.code, done.json["rows"][0]["model"]) == (0, "default.onnx")
