"""Words of a manifest -> files: globs and folders are searched, short names told apart, contents hashed once.

A file is an absolute path, or an address as batch.remote knows them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping, Sequence
from pathlib import Path, PurePath, PurePosixPath
from urllib.request import url2pathname

from wallkit.errors import ConfigError
from wallkit.pipelines.batch import remote
from wallkit.pipelines.run_folder import RESULT_MCAP, sha256

LOGS = (".mcap", ".bag", ".db3", ".clf")
BESIDE = "beside:"
# what stands for the content of a file that cannot be read; a run of it fails with the reason
UNREADABLE = "unreadable"
Digests = MutableMapping[str, tuple[int, int, str]]


def find_logs(words: Sequence[str], folder: Path, *, suffixes: Sequence[str] = LOGS, where: str) -> list[str]:
    """Every log named, once, in the order of the words and sorted within each.

    Raises:
        ConfigError: a word names nothing.
        WallkitError: an address cannot be looked at.
    """
    found: dict[str, None] = {}
    for word in words:
        is_address = remote.is_address(word)
        named = remote.logs_at(word, suffixes) if is_address else map(str, _named(word, folder, suffixes))
        here = dict.fromkeys(named)
        if not here:
            is_glob = remote.is_glob(word) if is_address else _is_glob(word)
            what = "matches nothing" if is_glob else "names no log"
            looked = "" if is_address else f"looked from {folder}; "
            hint = f"{looked}a folder is searched for {', '.join(suffixes)}"
            raise ConfigError(f"'{word}' {what}", where=where, hint=hint)
        found.update(here)
    return list(found)


def named_by(word: str, log: str, folder: Path) -> str:
    """A file from the manifest's folder; `beside:NAME` from the log's."""
    if remote.is_address(word):
        return word
    if not word.startswith(BESIDE):
        return str(folder / path_of(word))
    name = word.removeprefix(BESIDE)
    if remote.is_address(log):
        return remote.beside(log, name)
    return str((Path(log) if Path(log).is_dir() else Path(log).parent) / name)


def path_of(word: str) -> Path:
    """A word that is no address as a path."""
    return Path(url2pathname(word.removeprefix("file://")) if word.startswith("file://") else word).expanduser()


def is_there(word: str, folder: Path) -> bool:
    """Whether a word names a file or folder.

    Raises:
        WallkitError: an address cannot be looked at.
    """
    return remote.is_there(word) if remote.is_address(word) else (folder / path_of(word)).exists()


def short_names(files: Sequence[str]) -> list[str]:
    """A name for each that tells them apart, as short as can be: of the file, of its folder, of both, or all of it."""
    paths = [PurePosixPath("/", remote.path_in(f)) if remote.is_address(f) else PurePath(f) for f in files]
    ways: tuple[Callable[[PurePath], str], ...] = (
        lambda p: p.name.partition(".")[0],
        lambda p: p.parent.name,
        lambda p: f"{p.parent.name}-{p.name.partition('.')[0]}",
        lambda p: "-".join(p.with_suffix("").parts[1:]),
        lambda p: "-".join(p.parts[1:]),
    )
    for way in ways:
        names = [way(path) for path in paths]
        if len(set(names)) == len(names) and all(names):
            return names
    return [f"{i:05d}" for i in range(len(paths))]


def digest(path: Path, known: Digests) -> str:
    """sha256 of a file, or of the names and contents of a folder's; remembered by size and time of change."""
    if path.is_dir():
        inside = sorted(p for p in path.rglob("*") if p.is_file())
        return " ".join(f"{p.relative_to(path)}={digest(p, known)}" for p in inside)
    try:
        stat = path.stat()
        before = known.get(str(path))
        if before is not None and before[:2] == (stat.st_size, stat.st_mtime_ns):
            return before[2]
        found = sha256(path)
    except OSError:
        return UNREADABLE
    known[str(path)] = (stat.st_size, stat.st_mtime_ns, found)
    return found


def _named(word: str, folder: Path, suffixes: Sequence[str]) -> Iterator[Path]:
    path = path_of(word)
    if _is_glob(word):
        root, pattern = (
            (Path(path.anchor), str(path.relative_to(path.anchor))) if path.is_absolute() else (folder, word)
        )
        for match in sorted(root.glob(pattern)):
            if _is_hidden(match.relative_to(root)) and not _is_hidden(Path(pattern)):
                continue
            yield from _inside(match, suffixes) if match.is_dir() else (match,)
    elif (folder / path).is_dir():
        yield from _inside(folder / path, suffixes)
    elif (folder / path).exists():
        yield folder / path


def _is_hidden(path: Path) -> bool:
    """Whether a part of it is, as of folders that are still being written."""
    return any(part.startswith(".") and part not in (".", "..") for part in path.parts)


def _inside(folder: Path, suffixes: Sequence[str]) -> Iterator[Path]:
    """A rosbag2 folder is one log; any other holds logs."""
    if (folder / "metadata.yaml").is_file():
        yield folder
        return
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            yield from _inside(path, suffixes)
        elif path.suffix in suffixes and path.name != RESULT_MCAP:
            yield path


def _is_glob(word: str) -> bool:
    return any(letter in word for letter in "*?[")
