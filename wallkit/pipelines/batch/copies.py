"""Remote inputs of a run -> copies of them on this machine, fetched once and kept by content."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sqlite3
import threading
from collections.abc import Iterator, MutableMapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from wallkit.core.folders import cache_folder
from wallkit.errors import OutputError, WallkitError
from wallkit.pipelines.batch import remote

_IMAGE = re.compile(rb"""^image:\s*["']?([^"'#\r\n]+?)["']?\s*(?:#.*)?$""", re.MULTILINE)
_MESH = re.compile(rb"""\bfilename\s*=\s*["']([^"']+)["']""")
_WAIT_S = 3600.0


@dataclass(frozen=True)
class Copied:
    """A remote file with what belongs to it, or a folder, as it was when the batch was planned.

    Attributes:
        url: as written; of a folder with '/' at the end.
        files: (name from its folder, mark of the content) of all that is fetched.
    """

    url: str
    files: tuple[tuple[str, str], ...]

    @property
    def content(self) -> str:
        """Another one for another content; also for the same at another address."""
        return hashlib.sha256(repr((remote.bare(self.url), self.files)).encode()).hexdigest()[:32]


def seen(url: str, *, is_map: bool, known: MutableMapping[str, tuple[int, int, str]]) -> Copied:
    """What is there now; a file that cannot be seen has the mark "", and the run that needs it fails with the reason.

    Args:
        is_map: files that it names are part of it.
        known: names in maps, remembered; added to.

    Raises:
        WallkitError: nobody answers.
    """
    try:
        names = remote.files_below(url) if url.endswith("/") else [remote.name_of(url)]
        marks = [(name, remote.mark_of(_address(url, name))) for name in names]
        if is_map and marks[0][1]:
            key = f"{url} {marks[0][1]}"
            if key not in known:
                known[key] = (0, 0, "\n".join(named_in(remote.read_bytes(url))))
            beside = [(name, remote.mark_of(remote.beside(url, name))) for name in known[key][2].splitlines()]
            # the map's reader says what is missing
            marks += [(name, mark) for name, mark in beside if mark]
    except remote.UnseenError:
        marks = [(remote.name_of(url), "")]
    return Copied(url, tuple(marks))


def named_in(content: bytes) -> list[str]:
    """Files in and below its folder that a map names: the image of a raster, the meshes of a semantic map."""
    found = (_MESH if content.lstrip().startswith(b"<") else _IMAGE).findall(content)
    names = dict.fromkeys(name.decode(errors="replace").strip() for name in found)
    return [n for n in names if not n.startswith("/") and ".." not in PurePosixPath(n).parts and ":" not in n]


def fetched(copied: Copied, folder: str) -> Path:
    """The copy on this machine; processes that need it at the same time wait for the one that fetches it.

    Args:
        folder: of the cache; "" for the user's.

    Raises:
        WallkitError: it cannot be fetched, or is not what it was when the batch was planned.
    """
    cache = Path(folder).expanduser() if folder else cache_folder("inputs")
    place = cache / copied.content
    if not place.is_dir():
        try:
            with _alone(cache, copied.content) as is_alone:
                if not place.is_dir():
                    _fill(place, copied, is_alone=is_alone)
        except OSError as error:
            message = f"the copy of {copied.url} cannot be written: {error.strerror or error}"
            raise OutputError(
                message, where=cache, hint='cache = "FOLDER" in the manifest names another place'
            ) from error
    return place / remote.name_of(copied.url)


def _fill(place: Path, copied: Copied, *, is_alone: bool) -> None:
    # of processes that died
    for left in place.parent.glob(f".{place.name}.partial-*") if is_alone else ():
        shutil.rmtree(left, ignore_errors=True)
    working = place.with_name(f".{place.name}.partial-{os.getpid()}-{threading.get_ident()}")
    is_folder = copied.url.endswith("/")
    root = working / remote.name_of(copied.url) if is_folder else working
    try:
        for name, mark in copied.files:
            url = _address(copied.url, name)
            to = root / name
            to.parent.mkdir(parents=True, exist_ok=True)
            remote.download(url, str(to))
            if remote.mark_of(url, is_fresh=True) != mark:
                hint = "the same command plans it anew; finished runs of other logs stay"
                raise WallkitError("has changed since the batch was planned", where=url, hint=hint)
        try:
            working.rename(place)
        except OSError:
            # another one was faster
            if not place.is_dir():
                raise
    finally:
        shutil.rmtree(working, ignore_errors=True)


def _address(url: str, name: str) -> str:
    return url if name == remote.name_of(url) and not url.endswith("/") else remote.beside(url, name)


@contextmanager
def _alone(cache: Path, content: str) -> Iterator[bool]:
    """One process of this machine at a time; the lock goes with the process that holds it.

    Yields whether there is a lock: where files cannot be locked it may be fetched twice, and the first copy stays.
    """
    locks = cache / ".locks"
    locks.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        is_alone = False
        with suppress(sqlite3.Error):
            lock = sqlite3.connect(locks / content[:2], timeout=_WAIT_S, isolation_level=None)
            held.enter_context(closing(lock))
            lock.execute("BEGIN EXCLUSIVE")
            is_alone = True
        yield is_alone
