"""Directories and compressed files -> the plain files that hold a recording."""

from __future__ import annotations

import gzip
import shutil
import tempfile
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

from wallkit.errors import LogError

_SUFFIXES = (".mcap", ".db3", ".bag", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst", ".mcap.lz4")


@dataclass(frozen=True)
class Unpacked:
    """A plain file and where it came from; a temporary copy is removed with this object."""

    path: Path
    source: Path

    def __post_init__(self) -> None:
        if self.path != self.source:
            weakref.finalize(self, shutil.rmtree, self.path.parent, ignore_errors=True)


def files_of_directory(path: Path) -> list[Path]:
    """The recording's files in a rosbag2 directory: those its metadata.yaml names, else all that look like one.

    A recorder that was killed leaves no metadata.yaml; its files are no worse for that.

    Raises:
        LogError: there is none, one is missing, or they are compressed message by message.
    """
    metadata = path / "metadata.yaml"
    if not metadata.exists():
        files = sorted(p for p in path.iterdir() if p.name.endswith(_SUFFIXES))
        if not files:
            raise LogError("no recording in this directory", where=path, hint="name a log file, or a rosbag2 directory")
        return files
    information = _metadata_of(metadata)
    if str(information.get("compression_mode", "")).lower() == "message":
        hint = "unpack it with `ros2 bag convert`"
        raise LogError("its messages are compressed one by one, which wallkit does not read", where=path, hint=hint)
    files = [path / Path(str(name)).name for name in information.get("relative_file_paths", [])]
    if missing := [f.name for f in files if not f.exists()]:
        hint = "copy the whole directory, or remove metadata.yaml to read what is there"
        raise LogError(f"parts of the recording are missing: {', '.join(missing)}", where=metadata, hint=hint)
    return files


def unpacked(path: Path) -> Unpacked:
    """The file itself, or a temporary copy without its zstd, lz4 or gzip wrapping.

    Raises:
        LogError: the wrapping is damaged.
    """
    with path.open("rb") as file:
        magic = file.read(4)
    opener = next((o for m, o in WRAPPINGS.items() if magic.startswith(m)), None)
    if opener is None:
        return Unpacked(path, path)
    plain = Unpacked(Path(tempfile.mkdtemp(prefix="wallkit-")) / path.stem, path)
    try:
        _copy(opener, path, plain.path)
    except (OSError, EOFError, RuntimeError, ValueError) as error:
        raise LogError(f"the compressed file cannot be unpacked: {error}", where=path) from error
    return plain


def _copy(opener: Callable[[Path], IO[bytes]], source: Path, target: Path) -> None:
    with opener(source) as packed, target.open("wb") as plain:
        shutil.copyfileobj(packed, plain, 2**20)


def _metadata_of(path: Path) -> dict[str, Any]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    hint = "remove metadata.yaml to read the files beside it"
    try:
        content = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (YAMLError, OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot be read as YAML: {error}", where=path, hint=hint) from error
    information = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
    if not isinstance(information, dict):
        raise LogError("has no entry 'rosbag2_bagfile_information'", where=path, hint=hint)
    return information


def _open_zstd(path: Path) -> IO[bytes]:
    from backports import zstd

    return cast(IO[bytes], zstd.open(path, "rb"))


def _open_lz4(path: Path) -> IO[bytes]:
    import lz4.frame

    return cast(IO[bytes], lz4.frame.open(path, "rb"))


def _open_gzip(path: Path) -> IO[bytes]:
    return cast(IO[bytes], gzip.open(path, "rb"))


WRAPPINGS: dict[bytes, Callable[[Path], IO[bytes]]] = {
    b"\x28\xb5\x2f\xfd": _open_zstd,
    b"\x04\x22\x4d\x18": _open_lz4,
    b"\x1f\x8b": _open_gzip,
}
