"""Words of a manifest -> files: globs and folders are searched, short names told apart, contents hashed once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, MutableMapping, Sequence
from pathlib import Path

from wallkit.errors import ConfigError
from wallkit.pipelines.run_folder import RESULT_MCAP, sha256

LOGS = (".mcap", ".bag", ".db3", ".clf")
BESIDE = "beside:"
# what stands for the content of a file that cannot be read; a run of it fails with the reason
UNREADABLE = "unreadable"
Digests = MutableMapping[str, tuple[int, int, str]]


def find_logs(words: Sequence[str], folder: Path, *, suffixes: Sequence[str] = LOGS, where: str) -> list[Path]:
    """Every log named, once, in the order of the words and sorted within each.

    Raises:
        ConfigError: a word names nothing.
    """
    found: dict[Path, None] = {}
    for word in words:
        here = dict.fromkeys(_named(word, folder, suffixes))
        if not here:
            what = "matches nothing" if _is_glob(word) else "names no log"
            hint = f"looked from {folder}; a folder is searched for {', '.join(suffixes)}"
            raise ConfigError(f"'{word}' {what}", where=where, hint=hint)
        found.update(here)
    return list(found)


def named_by(word: str, log: Path, folder: Path) -> Path:
    """A file from the manifest's folder; `beside:NAME` from the log's."""
    if word.startswith(BESIDE):
        return (log if log.is_dir() else log.parent) / word.removeprefix(BESIDE)
    return folder / Path(word).expanduser()


def short_names(paths: Sequence[Path]) -> list[str]:
    """A name for each that tells them apart, as short as can be: of the file, of its folder, of both, or all of it."""
    ways: tuple[Callable[[Path], str], ...] = (
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
    path = Path(word).expanduser()
    if _is_glob(word):
        root, pattern = (
            (Path(path.anchor), str(path.relative_to(path.anchor))) if path.is_absolute() else (folder, word)
        )
        for match in sorted(root.glob(pattern)):
            yield from _inside(match, suffixes) if match.is_dir() else (match,)
    elif (folder / path).is_dir():
        yield from _inside(folder / path, suffixes)
    elif (folder / path).exists():
        yield folder / path


def _inside(folder: Path, suffixes: Sequence[str]) -> Iterator[Path]:
    """A rosbag2 folder is one log; any other holds logs."""
    if (folder / "metadata.yaml").is_file():
        yield folder
        return
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            yield from _inside(path, suffixes)
        elif path.suffix in suffixes and path.name != RESULT_MCAP:
            yield path


def _is_glob(word: str) -> bool:
    return any(letter in word for letter in "*?[")
