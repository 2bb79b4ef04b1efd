"""Folders of results: whole or not there, and what they replace is lost only once they are."""

from __future__ import annotations

import pytest

from wallkit.errors import OutputError
from wallkit.pipelines.outputs import put_in_place, result_folder


@pytest.fixture
def out(tmp_path):
    """A result that is there already."""
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "run.json").write_text("old")
    return folder


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_folder_that_cannot_be_moved_leaves_the_old_one(out, tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        put_in_place(tmp_path / "never made", out)
    assert names(tmp_path) == ["out", "out/run.json"]
    assert (out / "run.json").read_text() == "old"


def test_what_fails_half_way_leaves_the_old_one(out, tmp_path):
    def stop():
        with result_folder(out, overwrite=True) as working:
            (working / "run.json").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop()
    assert names(tmp_path) == ["out", "out/run.json"]
    assert (out / "run.json").read_text() == "old"


def test_what_is_finished_takes_the_place_of_the_old_one(out, tmp_path):
    with result_folder(out, overwrite=True) as working:
        (working / "more.txt").write_text("new")
    assert names(tmp_path) == ["out", "out/more.txt"]


def test_a_link_is_replaced_and_what_it_led_to_stays(out, tmp_path):
    link, working = tmp_path / "link", tmp_path / "working"
    link.symlink_to(out)
    working.mkdir()
    put_in_place(working, link)
    assert names(tmp_path) == ["link", "out", "out/run.json"]
    assert not link.is_symlink()
