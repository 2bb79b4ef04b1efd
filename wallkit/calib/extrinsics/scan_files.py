"""Folders of scans -> points by name, and which scan belongs to which picture."""

from __future__ import annotations

import gzip
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import CalibrationError

SUFFIXES = (".pcd", ".pcd.gz", ".csv", ".npz")
# a number of so many digits in a name is a stamp in nanoseconds
_STAMP_DIGITS = 16
_FLAT_M = 1e-3


@dataclass(frozen=True, eq=False)
class ScanFile:
    """Points (K, 3) of one file in the LiDAR frame [m], with their rings and intensities where it has them."""

    name: str
    points_m: Float64Array
    rings: Int64Array | None = None
    intensities: Float64Array | None = None

    @property
    def is_planar(self) -> bool:
        """Whether all returns lie in the plane z = 0."""
        return bool(len(self.points_m)) and float(np.abs(self.points_m[:, 2]).max()) < _FLAT_M


def scan_files(folder: Path) -> list[Path]:
    """The scans in a folder, by name.

    Raises:
        CalibrationError: no such folder, or none in it.
    """
    if not folder.is_dir():
        raise CalibrationError(
            "is no folder of scans", where=folder, hint="give --scans a folder of .pcd, .csv or .npz files"
        )
    found = sorted(p for p in folder.iterdir() if p.name.endswith(SUFFIXES))
    if not found:
        raise CalibrationError(f"holds no scans ({', '.join(SUFFIXES)})", where=folder)
    return found


def read_scan(path: Path) -> ScanFile:
    """The points of a PCD (ASCII or binary, gzip too), a CSV (head line, or x,y[,z]), or an NPZ with `points` or `ranges`.

    An NPZ of a LaserScan has `ranges` with `angle_min` and `angle_increment`, or with `angles`.

    Raises:
        CalibrationError: it cannot be read, or holds no point.
    """
    try:
        name, data = path.name, path.read_bytes()
        if name.endswith(".gz"):
            data = gzip.decompress(data)
        if ".pcd" in name:
            columns = _pcd(data)
        elif name.endswith(".npz"):
            columns = _npz(path)
        else:
            columns = _csv(data.decode())
    except (OSError, EOFError, ValueError, KeyError, TypeError) as error:
        raise CalibrationError(f"cannot be read as a scan: {error}", where=path) from error
    x, y = columns["x"], columns["y"]
    points = np.column_stack([x, y, columns.get("z", np.zeros(len(x)))]).astype(np.float64)
    rings = columns.get("ring")
    seen = np.isfinite(points).all(axis=1) & (np.linalg.norm(points, axis=1) > 1e-3)
    if not seen.any():
        raise CalibrationError(f"the scan is empty: none of its {len(points)} points is a return", where=path)
    intensities = columns.get("intensity")
    return ScanFile(
        path.name,
        points[seen],
        None if rings is None else np.asarray(rings, np.int64)[seen],
        None if intensities is None else np.asarray(intensities, np.float64)[seen],
    )


def paired(pictures: Sequence[str], scans: Sequence[str], *, tolerance_s: float = 0.1) -> list[tuple[int, int]]:
    """(picture, scan) indices that belong together: the nearest stamp when names are stamps in nanoseconds, else the same
    name, or the same first number in it."""
    if all(_is_stamp(name) for name in (*pictures, *scans)):
        times = np.array([int(_stem(name)) for name in scans], dtype=np.int64)
        gaps = [np.abs(times - int(_stem(name))) for name in pictures]
        return [(i, int(gap.argmin())) for i, gap in enumerate(gaps) if gap.min() <= tolerance_s * 1e9]
    stems = {_stem(name): j for j, name in reversed(list(enumerate(scans)))}
    numbers = {_number(name): j for j, name in reversed(list(enumerate(scans))) if _number(name) is not None}
    found = []
    for i, name in enumerate(pictures):
        j = stems.get(_stem(name), numbers.get(_number(name)))
        if j is not None:
            found.append((i, j))
    return found


# ------------------------------------------------------------------------------------------------ details


def _pcd(data: bytes) -> dict[str, Float64Array]:
    head, kind, body = re.split(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", data, maxsplit=1, flags=re.MULTILINE)
    lines = dict(
        line.split(None, 1) for line in head.decode("ascii", "replace").splitlines() if " " in line and line[0] != "#"
    )
    fields, count = lines["FIELDS"].split(), int(lines["POINTS"])
    if kind == b"ascii":
        table = np.array([[float(v) for v in row.split()] for row in body.decode().splitlines() if row.strip()])
        if len(table) != count:
            raise ValueError(f"it says {count} points and has {len(table)}")
        return {name: table[:, i] for i, name in enumerate(fields)} if count else {"x": np.zeros(0), "y": np.zeros(0)}
    if kind != b"binary":
        raise ValueError(f"DATA {kind.decode()} is not read; convert it with pcl_convert_pcd_ascii_binary")
    kinds = {"F": "f", "U": "u", "I": "i"}
    types = [f"<{kinds[t]}{s}" for t, s in zip(lines["TYPE"].split(), lines["SIZE"].split(), strict=True)]
    counts = [int(c) for c in lines.get("COUNT", " ".join("1" for _ in fields)).split()]
    record = np.dtype([(n, t, c) if c > 1 else (n, t) for n, t, c in zip(fields, types, counts, strict=True)])
    table = np.frombuffer(body, record, count)
    return {name: table[name].astype(np.float64) for name in fields}


def _npz(path: Path) -> dict[str, Float64Array]:
    with np.load(path, allow_pickle=False) as arrays:
        if "points" in arrays:
            points = np.asarray(arrays["points"], dtype=np.float64)
            columns = dict(zip("xyz", points.T, strict=False))
            more = {"ring": "rings", "intensity": "intensities"}
            return {**columns, **{name: arrays[key] for name, key in more.items() if key in arrays}}
        if "ranges" not in arrays:
            raise ValueError(f"it has {', '.join(arrays.files)}, neither points nor ranges")
        ranges = np.asarray(arrays["ranges"], dtype=np.float64)
        if "angles" in arrays:
            angles = np.asarray(arrays["angles"], dtype=np.float64)
        else:
            angles = float(arrays["angle_min"]) + float(arrays["angle_increment"]) * np.arange(
                len(ranges), dtype=np.float64
            )
        ranges = np.where(np.isfinite(ranges), ranges, np.nan)
        return {"x": ranges * np.cos(angles), "y": ranges * np.sin(angles)}


def _csv(text: str) -> dict[str, Float64Array]:
    rows = [[word.strip() for word in re.split(r"[,;\s]+", line.strip())] for line in text.splitlines() if line.strip()]
    names = [word.lower() for word in rows[0]]
    has_head = not re.fullmatch(r"[-+.\deE]+", names[0])
    table = np.array([[float(word) for word in row] for row in rows[has_head:]]).reshape(-1, len(rows[0]))
    if not has_head:
        names = ["x", "y", "z"][: len(names)]
    columns = dict(zip(names, table.T, strict=False))
    if "range" in columns and "angle" in columns:
        ranges = np.where(np.isfinite(columns["range"]), columns["range"], np.nan)
        return {"x": ranges * np.cos(columns["angle"]), "y": ranges * np.sin(columns["angle"])}
    return columns


def _stem(name: str) -> str:
    return name.split(".")[0]


def _number(name: str) -> int | None:
    found = re.search(r"\d+", name)
    return int(found[0]) if found else None


def _is_stamp(name: str) -> bool:
    stem = _stem(name)
    return stem.isdecimal() and len(stem) >= _STAMP_DIGITS
