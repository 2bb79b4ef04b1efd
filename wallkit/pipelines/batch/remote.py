"""Addresses such as s3://bucket/log.mcap -> what lies there and a mark of its content, through fsspec.

An address stays as the user wrote it. One of a folder ends with '/'; `zip://*.mcap::s3://bucket/a.zip` is a chain, and what
comes after '::' or, of http, after '?' stays at its end.
"""

from __future__ import annotations

import errno
import hashlib
import posixpath
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from wallkit.errors import WallkitError
from wallkit.pipelines.run_folder import RESULT_MCAP

_ADDRESS = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+(://|::.*://)")
_MAGIC = re.compile(r"[*?[]")
_MAGIC_OF_HTTP = re.compile(r"[*[]")
# what says that a content is the same: of S3, Google, Azure, HTTP, OCI, Dropbox, Hugging Face, git, GitHub and zip
_TAGS = ("etag", "e_tag", "md5hash", "content_md5", "content-md5", "content_hash", "blob_id", "hex", "sha", "digest",
         "crc")  # fmt: skip
# when it was changed; `time` of SFTP is when it was read
_TIMES = ("lastmodified", "last_modified", "last-modified", "mtime", "modified", "modify", "updated", "modificationtime",
          "last_write_time", "date_time", "created")  # fmt: skip
_AGAIN = "failed runs are done again with `--retry`"
_REFUSED = (401, 403, 407)
_OF_THIS_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
_GUIDE = "docs/how-to/run-on-a-cluster.md says where credentials are looked for"


class UnseenError(WallkitError):
    """A file that is not there or that nobody shows us; others of the same place may be."""


def is_address(word: str) -> bool:
    """Whether fsspec is asked for it; file:// is a path."""
    return _ADDRESS.match(word) is not None and not word.startswith("file://")


def beside(url: str, name: str) -> str:
    """The address of a file in the same folder, or below a folder's own."""
    head, tail = _cut(url)
    scheme, _, path = head.partition("://")
    return f"{scheme}://{_joined(posixpath.dirname(path), name)}{tail}"


def path_in(url: str) -> str:
    """Where it lies, from its bucket, host or archive on."""
    return _cut(url)[0].rpartition("://")[2]


def name_of(url: str) -> str:
    """The name of a file or folder."""
    return path_in(url).rstrip("/").rpartition("/")[2]


def bare(url: str) -> str:
    """Without what follows '?' in http: a signature is another one every day."""
    return url.partition("?")[0] if url.startswith(("http://", "https://")) else url


def logs_at(word: str, suffixes: Sequence[str]) -> Iterator[str]:
    """The addresses of logs that a file, a folder or a glob names; none if nothing is there.

    Raises:
        WallkitError: its driver is missing, access is refused, or nobody answers.
    """
    with explained(word):
        fs, path = _opened(word)
        if is_glob(word):
            yield from _matching(fs, path, word, suffixes)
        elif word.endswith("/") or ((info := _info(fs, path)) is not None and info["type"] == "directory"):
            yield from _inside(fs, path, word, suffixes)
        elif info is not None:
            yield word


def is_glob(word: str) -> bool:
    """Whether it has a pattern in it; '?' is none in http."""
    magic = _MAGIC_OF_HTTP if word.startswith(("http://", "https://")) else _MAGIC
    return magic.search(_cut(word)[0]) is not None


def is_there(url: str) -> bool:
    """Whether there is such a file or folder.

    Raises:
        WallkitError: see logs_at.
    """
    with explained(url):
        return _info(*_opened(url)) is not None


def files_below(url: str) -> list[str]:
    """Names of all files in and below a folder, from the folder.

    Raises:
        WallkitError: see logs_at.
    """
    with explained(url):
        fs, path = _opened(url)
        return sorted(_below(found, path) for found in fs.find(path))


def mark_of(url: str, *, is_fresh: bool = False) -> str:
    """Size and ETag of a file, else size and time of change, else its sha256; "" if there is no such file.

    Args:
        is_fresh: asks again, whatever was said in a listing.

    Raises:
        WallkitError: see logs_at.
    """
    with explained(url):
        fs, path = _opened(url)
        if is_fresh:
            fs.invalidate_cache()
        info = _info(fs, path)
        if info is None:
            return ""
        said = {key.lower(): value for key, value in info.items() if value}
        for key in (*_TAGS, *_TIMES):
            if key in said:
                return f"{said.get('size')} {str(said[key]).strip(chr(34))}"
        with fs.open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def read_bytes(url: str) -> bytes:
    """A small file.

    Raises:
        WallkitError: see logs_at; or it is not there.
    """
    with explained(url):
        fs, path = _opened(url)
        return bytes(fs.cat_file(path))


def download(url: str, to: str) -> None:
    """Copy a file to a path.

    Raises:
        WallkitError: see read_bytes.
    """
    with explained(url):
        fs, path = _opened(url)
        fs.get_file(path, to)


@contextmanager
def explained(url: str) -> Iterator[None]:
    """What goes wrong in a driver, as a sentence about the address."""
    try:
        yield
    except WallkitError:
        raise
    except OSError as error:
        if error.errno in _OF_THIS_DISK:
            raise
        raise _sentence(url, error) from error
    except Exception as error:
        raise _sentence(url, error) from error


def _sentence(url: str, error: Exception) -> WallkitError:
    error = _reason(error)
    status = getattr(error, "status", None) or getattr(error, "code", None)
    said = (str(error) or type(error).__name__).splitlines()[0]
    if isinstance(error, ImportError):
        return WallkitError(f"needs a driver that is not installed: {said}", where=url, hint=_how_to_install(url))
    if isinstance(error, ValueError) and "rotocol not known" in said:
        return WallkitError(
            "begins with a protocol that fsspec does not know", where=url, hint="s3://, gs://, sftp:// ..."
        )
    is_refused = isinstance(error, PermissionError) or status in _REFUSED
    if is_refused or re.search("Credential|Authenti", type(error).__name__):
        return UnseenError(f"access is refused: {said}", where=url, hint=_GUIDE)
    if isinstance(error, FileNotFoundError) or status == 404:
        return UnseenError("is not there", where=url, hint="was it moved or deleted? " + _AGAIN)
    kind = UnseenError if status is not None else WallkitError
    return kind(
        f"cannot be read: {type(error).__name__}: {said}", where=url, hint="does this machine reach it? " + _AGAIN
    )


def _how_to_install(url: str) -> str:
    """The pip command for a protocol's driver."""
    from importlib.metadata import PackageNotFoundError, metadata

    try:
        extras = metadata("fsspec").get_all("Provides-Extra") or []
    except PackageNotFoundError:
        return "pip install 'wallkit[remote]'"
    name = re.split("://|::", url)[0].lower()
    name = {"https": "http", "s3a": "s3", "az": "abfs", "abfss": "abfs"}.get(name, name)
    return f"pip install 'fsspec[{name}]'" if name in extras else f"install what fsspec needs for {name}://"


def _opened(url: str) -> tuple[Any, str]:
    """A file system, and the address as it calls it."""
    from fsspec.core import url_to_fs

    fs, path = url_to_fs(url)
    return fs, str(path)


def _info(fs: Any, path: str) -> Mapping[str, Any] | None:
    """What is said of a file or folder; None if nothing is there."""
    try:
        return dict(fs.info(path))
    except FileNotFoundError as error:
        if _reason(error) is not error:
            raise
        return None


def _reason(error: Exception) -> Exception:
    """Why a file is called missing: http says so of everything, also when nobody answers."""
    cause = error.__cause__
    is_told = getattr(cause, "status", 404) != 404
    is_unreached = isinstance(cause, OSError) and not isinstance(cause, FileNotFoundError)
    return cause if isinstance(cause, Exception) and (is_told or is_unreached) else error


def _matching(fs: Any, path: str, word: str, suffixes: Sequence[str]) -> Iterator[str]:
    head, tail = _cut(word)
    fixed = _MAGIC.split(head)[0]
    root = fixed[: fixed.rindex("/") + 1]
    root_path = str(fs._strip_protocol(root + tail))
    for found, info in sorted(fs.glob(path, detail=True).items()):
        url = root + _below(found, root_path) + tail
        if info["type"] == "directory":
            yield from _inside(fs, found, url, suffixes)
        else:
            yield url


def _inside(fs: Any, path: str, url: str, suffixes: Sequence[str]) -> Iterator[str]:
    """As files._inside: a rosbag2 folder is one log; any other holds logs."""
    head, tail = _cut(url)
    entries = {_below(entry["name"], path): entry for entry in fs.ls(path, detail=True)}
    # object stores list a folder in itself
    entries.pop("", None)
    if "metadata.yaml" in entries:
        yield f"{head.rstrip('/')}/{tail}"
        return
    for name, entry in sorted(entries.items()):
        inner = f"{head.rstrip('/')}/{name}{tail}"
        if entry["type"] == "directory":
            yield from _inside(fs, entry["name"], inner, suffixes)
        elif posixpath.splitext(name)[1] in suffixes and name != RESULT_MCAP:
            yield inner


def _below(path: str, root: str) -> str:
    return path.strip("/").removeprefix(root.strip("/")).strip("/")


def _joined(folder: str, name: str) -> str:
    return posixpath.normpath(f"{folder}/{name}") if ".." in name.split("/") else f"{folder}/{name}"


def _cut(url: str) -> tuple[str, str]:
    """Where the file is, and what stays at the end of every address there."""
    head, chain, rest = url.partition("::")
    if "://" not in head:
        # simplecache::s3://bucket/log.mcap: the path is in the next part
        inner, tail = _cut(rest)
        return f"{head}::{inner}", tail
    if not head.startswith(("http://", "https://")):
        return head, chain + rest
    path, mark, query = head.partition("?")
    return path, mark + query + chain + rest
