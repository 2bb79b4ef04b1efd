"""What a result remembers holds on any machine: no path from the root, every input told apart."""

from __future__ import annotations

import hashlib
import shutil

import cv2
import numpy as np
from click.testing import CliRunner

from tests.calib.drawn import board_poses, picture
from wallkit.calib.files.store import read_calibration
from wallkit.cli.calib.intrinsics import intrinsics
from wallkit.pipelines.provenance import digests, portable

WORDS = ("--board", "chessboard:9x6:0.03", "--model", "k1k2", "-q")


def test_paths_from_the_root_and_from_above_lose_their_place():
    assert portable("lens/images") == "lens/images"
    assert portable("/home/me/lens/images") == "images"
    assert portable("../secret/log.mcap") == "log.mcap"
    assert portable("~/log.mcap") == "log.mcap"
    assert portable("chessboard:9x6:0.03") == "chessboard:9x6:0.03"


def test_files_of_one_name_are_told_apart(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "0.png").write_text(folder)
    (tmp_path / "c.toml").write_text("c")
    files = [tmp_path / "a" / "0.png", tmp_path / "b" / "0.png", tmp_path / "c.toml", tmp_path / "c.toml", tmp_path]
    found = digests(files)
    assert list(found) == ["a/0.png", "b/0.png", "c.toml"]
    assert found["b/0.png"] == hashlib.sha256(b"b").hexdigest()


def test_the_same_pictures_elsewhere_make_the_same_bytes(tmp_path, monkeypatch):
    """Named from the root or from here, in one folder or another: the file that is stored does not differ."""
    here = tmp_path / "here" / "pictures"
    here.mkdir(parents=True)
    for number, pose in enumerate(board_poses(np.random.default_rng(2), 4, spread=0.35)):
        cv2.imwrite(str(here / f"{number}.png"), picture(pose))
    there = tmp_path / "elsewhere" / "pictures"
    shutil.copytree(here, there)
    stored = []
    monkeypatch.chdir(here.parent)
    for given in (str(there), "pictures"):
        out = tmp_path / f"{len(stored)}.toml"
        done = CliRunner().invoke(intrinsics, [given, *WORDS, "-o", str(out)])
        assert done.exit_code == 4, done.output
        stored.append(out.read_bytes())
    assert stored[0] == stored[1]
    made = read_calibration(tmp_path / "0.toml").provenance
    assert made.command == "wallkit calib intrinsics pictures --board chessboard:9x6:0.03 --model k1k2"
    assert str(tmp_path).encode() not in stored[0]
