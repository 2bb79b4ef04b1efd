"""A wallkit.toml of another folder: its files are beside it, and words that name no file stay as they are."""

from __future__ import annotations

import pytest

from wallkit.pipelines.config import load_config


@pytest.fixture
def loaded(tmp_path, monkeypatch):
    """The settings of a file in another folder, as named from here."""
    folder = tmp_path / "floor"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)

    def load(text: str):
        (folder / "wallkit.toml").write_text(text)
        return load_config(folder.joinpath("wallkit.toml").relative_to(tmp_path)).config

    return load


def test_files_are_beside_their_settings(loaded):
    found = loaded('map = "floor.yaml"\nceiling = "c.png"\n[segment]\nmodel = "best.onnx"\ncache = "seen"\n')
    assert (found.map, found.ceiling) == ("floor/floor.yaml", "floor/c.png")
    assert (found.segment.model, found.segment.cache) == ("floor/best.onnx", "floor/seen")
    assert loaded('[segment]\nmodel = "/models/best.onnx"\n').segment.model == "/models/best.onnx"


@pytest.mark.parametrize(
    ("key", "word"), [("model", "default"), ("model", "oracle"), ("cache", "user"), ("model", "s3://fleet/best.onnx")]
)
def test_words_that_name_no_file_stay(loaded, key, word):
    assert getattr(loaded(f'[segment]\n{key} = "{word}"\n').segment, key) == word
