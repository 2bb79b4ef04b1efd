"""Inputs at addresses: found, told apart by content, fetched once, and the same results as of files here."""

from __future__ import annotations

import csv
import errno
import importlib
import io
import pickle
import re
import sqlite3
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

import wallkit
from wallkit.batch.store import open_store
from wallkit.errors import ConfigError, WallkitError
from wallkit.pipelines.batch.copies import fetched, named_in, seen
from wallkit.pipelines.batch.files import find_logs, named_by, short_names
from wallkit.pipelines.batch.manifest import read_manifest
from wallkit.pipelines.batch.plan import plan_of
from wallkit.pipelines.batch.remote import beside, is_address, mark_of
from wallkit.pipelines.batch.run import run_batch
from wallkit.pipelines.batch.work import do_piece

fsspec = pytest.importorskip("fsspec")
SAMPLE = Path(wallkit.__file__).parent / "sample"
MANIFEST = """
logs = ["{root}/*/log.mcap"]
maps = ["beside:floor.wkmap.urdf"]
init = "truth"
end_s = 2
cache = "cache"
[settings.localize]
particles = 50
"""


@pytest.fixture
def memory():
    fs = fsspec.filesystem("memory")
    fs.store.clear()
    fs.pseudo_dirs[:] = [""]
    yield fs
    fs.store.clear()


def planned(folder: Path, text: str):
    (folder / "m.toml").write_text(text)
    return plan_of(read_manifest(folder / "m.toml"), folder / "out", {})


def ran(folder: Path, text: str, out: str, *, before=lambda: None) -> list[dict[str, str]]:
    """Rows of the table, without what differs between places and machines; done in this process."""
    (folder / "m.toml").write_text(text)
    read = read_manifest(folder / "m.toml")
    with open_store(folder / out) as store:
        plan = plan_of(read, folder / out, {})
        before()
        run_batch(read, plan, store, as_a_worker, retry=True)
    rows = csv.DictReader(io.StringIO((folder / out / "batch.csv").read_text()))
    return [
        {k: v for k, v in row.items() if not k.startswith("timing.") and k not in ("log", "map", "key")} for row in rows
    ]


def as_a_worker(pieces):
    """Each piece as it arrives in another process."""
    for piece in pieces:
        yield do_piece(pickle.loads(pickle.dumps(piece)), wallkit.__version__)


def put_sample(fs, root: str) -> None:
    for name in ("log.mcap", "floor.wkmap.urdf"):
        fs.pipe(f"{root}/{name}", (SAMPLE / name).read_bytes())


def test_globs_folders_and_bags_are_found_as_they_are_here(memory, tmp_path):
    names = ("a/log.mcap", "b/log.mcap", "b/result.mcap", "b/notes.txt", "bag/metadata.yaml", "bag/1.db3", "c/d/1.bag")
    for name in names:
        memory.pipe(f"/fleet/{name}", b"x")
        (tmp_path / "fleet" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "fleet" / name).write_bytes(b"x")
    for words in (["fleet"], ["fleet/*"], ["fleet/**/log.mcap"], ["fleet/b/log.mcap", "fleet/*/log.mcap"]):
        here = find_logs(words, tmp_path, where="")
        there = find_logs([f"memory://{word}" for word in words], tmp_path, where="")
        assert [url.removeprefix("memory://").rstrip("/") for url in there] == [
            Path(path).relative_to(tmp_path).as_posix() for path in here
        ]
        assert short_names(there) == short_names(here)
    assert find_logs([f"file://{tmp_path}/fleet/c"], tmp_path, where="") == [str(tmp_path / "fleet/c/d/1.bag")]
    for word, said in (("memory://fleet/*.clf", "matches nothing"), ("memory://nowhere", "names no log")):
        with pytest.raises(ConfigError, match=f"'{word[:14]}.*{said}"):
            find_logs([word], tmp_path, where="m.toml")


def test_beside_is_the_folder_of_the_log_whatever_follows_it():
    assert beside("s3://b/x/log.mcap", "map.yaml") == "s3://b/x/map.yaml"
    assert beside("s3://b/x/bag/", "map.yaml") == "s3://b/x/bag/map.yaml"
    assert named_by("beside:../map.yaml", "s3://b/x/log.mcap", Path("/")) == "s3://b/map.yaml"
    assert beside("https://h/x/log.mcap?sig=a/b", "map.yaml") == "https://h/x/map.yaml?sig=a/b"
    assert beside("zip://x/log.mcap::s3://b/a.zip", "map.yaml") == "zip://x/map.yaml::s3://b/a.zip"
    assert short_names([f"zip://{name}.mcap::s3://b/a.zip" for name in "xy"]) == ["x", "y"]
    assert short_names([f"https://h/{name}/log.mcap?sig=a/{name}" for name in "xy"]) == ["x", "y"]
    assert beside("simplecache::s3://b/x/log.mcap", "map.yaml") == "simplecache::s3://b/x/map.yaml"
    assert not any(map(is_address, ("a/b.mcap", "C:\\logs", "C:/logs", "beside:map.yaml", "file:///x")))


def test_the_key_follows_the_content_and_what_a_map_names(memory, tmp_path):
    memory.pipe("/x/log.mcap", b"log")
    memory.pipe("/x/floor.yaml", b"image: floor.pgm  # walls\n")
    memory.pipe("/x/floor.pgm", b"walls")
    text = 'logs = ["memory://x/log.mcap"]\nmaps = ["memory://x/floor.yaml"]\n'

    def key() -> str:
        return next(planned(tmp_path, text).asked()).key

    first = key()
    assert key() == first
    memory.pipe("/x/floor.pgm", b"WALLS")
    second = key()
    assert second != first
    memory.pipe("/x/log.mcap", b"LOG")
    assert key() not in (first, second)
    copy = fetched(seen("memory://x/floor.yaml", is_map=True, known={}), str(tmp_path / "c"))
    assert (copy.with_name("floor.pgm").read_bytes(), copy.name) == (b"WALLS", "floor.yaml")
    assert named_in(b'<robot><mesh filename="m/a.stl"/><mesh filename="package://b.stl"/></robot>') == ["m/a.stl"]
    assert named_in(b"image: ../elsewhere.pgm\n") == []


def test_a_tag_is_better_than_a_time_and_without_both_the_content_is_read(memory, monkeypatch):
    memory.pipe("/log.mcap", b"log")
    said = {"type": "file", "size": 3, "ETag": '"abc"', "LastModified": "today"}
    monkeypatch.setattr(type(memory), "info", lambda self, path: said)
    assert mark_of("memory://log.mcap") == "3 abc"
    del said["ETag"]
    assert mark_of("memory://log.mcap") == "3 today"
    del said["LastModified"]
    before = mark_of("memory://log.mcap")
    memory.pipe("/log.mcap", b"LOG")
    assert mark_of("memory://log.mcap") != before


def test_what_goes_wrong_is_one_sentence_about_the_address(memory, monkeypatch):
    missing = {"class": "no_such_driver.FS", "err": "Install no_such_driver"}
    registry = importlib.import_module("fsspec.registry")
    monkeypatch.setitem(registry.known_implementations, "s3", missing)
    monkeypatch.delitem(registry._registry, "s3", raising=False)
    for url, said, hint in (
        ("s3://b/log.mcap", "driver that is not installed: Install no_such_driver", r"pip install 'fsspec\[s3\]'"),
        ("nonsense://b/log.mcap", "a protocol that fsspec does not know", "s3://"),
        ("memory://refused.mcap", "access is refused: no", "run-on-a-cluster.md"),
    ):
        monkeypatch.setattr(type(memory), "info", _refuse)
        with pytest.raises(WallkitError, match=said) as caught:
            find_logs([url], Path("/"), where="")
        assert caught.value.where == url
        assert re.search(hint, caught.value.hint)


def _no_lock(*words, **options):
    raise sqlite3.OperationalError("locking protocol")


def _refuse(self, path):
    raise PermissionError("no")


@pytest.mark.long
def test_the_same_batch_from_addresses_and_what_vanishes_or_changes_fails_alone(memory, tmp_path):
    for name in "abc":
        put_sample(memory, f"/fleet/{name}")
    memory.get("/fleet", str(tmp_path / "fleet"), recursive=True)
    here = ran(tmp_path, MANIFEST.format(root="fleet"), "here")
    assert {row["status"] for row in here} == {"done"}

    def spoil():
        memory.rm("/fleet/b/log.mcap")
        memory.pipe("/fleet/c/log.mcap", b"another one")

    text = MANIFEST.format(root="memory://fleet")
    there = ran(tmp_path, text, "there", before=spoil)
    assert there[0] == here[0]
    assert [row["status"] for row in there] == ["done", "failed", "failed"]
    assert there[1]["message"].startswith("memory://fleet/b/log.mcap: is not there")
    assert there[2]["message"].startswith("memory://fleet/c/log.mcap: has changed since the batch was planned")
    run = (tmp_path / "there" / there[0]["folder"] / "run.json").read_text()
    assert '"memory://fleet/a/log.mcap"' in run
    assert str(tmp_path / "cache") not in run
    # put back, they are done from where they are; what is here already is not fetched again
    put_sample(memory, "/fleet/b")
    put_sample(memory, "/fleet/c")
    assert ran(tmp_path, text, "there", before=lambda: memory.rm("/fleet/a/log.mcap")) == here
    assert not list((tmp_path / "cache").glob("*.partial-*"))


def test_it_is_fetched_once_and_a_full_disk_is_told_as_one(memory, tmp_path, monkeypatch):
    memory.pipe("/log.mcap", b"log")
    copied = seen("memory://log.mcap", is_map=False, known={})
    got, get = [], type(memory).get_file

    def slowly(self, path, to):
        got.append(to)
        threading.Event().wait(0.05)
        get(self, path, to)

    monkeypatch.setattr(type(memory), "get_file", slowly)
    with ThreadPoolExecutor(4) as pool:
        paths = set(pool.map(lambda _: fetched(copied, str(tmp_path / "c")), range(4)))
    assert (len(got), {path.read_bytes() for path in paths}) == (1, {b"log"})
    # where nothing can be locked, all of them fetch it, and one copy stays
    monkeypatch.setattr("wallkit.pipelines.batch.copies.sqlite3.connect", _no_lock)
    with ThreadPoolExecutor(4) as pool:
        paths = set(pool.map(lambda _: fetched(copied, str(tmp_path / "d")), range(4)))
    assert (len(paths), {path.read_bytes() for path in paths}) == (1, {b"log"})
    assert sorted(path.name for path in (tmp_path / "d").iterdir()) == [".locks", copied.content]

    def full(self, path, to):
        Path(to).write_bytes(b"l")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(type(memory), "get_file", full)
    with pytest.raises(WallkitError, match=r"memory://log\.mcap cannot be written: No space left") as caught:
        fetched(copied, str(tmp_path / "full"))
    assert caught.value.where == str(tmp_path / "full")
    assert [path.name for path in (tmp_path / "full").iterdir()] == [".locks"]


def test_a_bad_log_is_named_by_its_address(memory, tmp_path):
    memory.pipe("/fleet/a/log.mcap", b"no recording")
    memory.pipe("/fleet/a/floor.wkmap.urdf", b"<robot")
    (row,) = ran(tmp_path, MANIFEST.format(root="memory://fleet"), "o")
    assert row["message"].startswith("memory://fleet/a/log.mcap")
    assert str(tmp_path) not in row["message"]


def test_the_same_batch_by_http(tmp_path):
    pytest.importorskip("aiohttp")
    (tmp_path / "fleet").mkdir()
    (tmp_path / "fleet" / "a").symlink_to(SAMPLE)
    here = ran(tmp_path, MANIFEST.format(root="fleet"), "here")
    handler = partial(_Quiet, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        root = f"http://127.0.0.1:{server.server_port}/fleet"
        assert ran(tmp_path, MANIFEST.format(root=root), "there") == here
        server.shutdown()
    with pytest.raises(WallkitError, match="cannot be read: ClientConnector"):
        seen(f"{root}/a/log.mcap", is_map=False, known={})


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *words):
        pass
