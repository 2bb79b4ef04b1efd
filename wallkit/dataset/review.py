"""Pictures in the order they were taken -> which of them to leave out, and why; and the list that a person edits."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array, UInt8Array
from wallkit.errors import DatasetError, closest

_HEADER = ("name", "drop", "reason", "number")
_THUMB = (32, 24)
_WORDS = {"yes": True, "no": False}


@dataclass(frozen=True)
class Proposal:
    """A picture that is better left out: why, and the number that says so."""

    name: str
    reason: str
    number: float


@dataclass(frozen=True)
class Judging:
    """duplicate: mean grey difference to the last kept picture below which it shows nothing new, of 255.
    blurred: sharpness below which a picture is blurred, relative to the median of its log."""

    duplicate: float = 2.0
    blurred: float = 0.25


def sharpness(image: UInt8Array) -> float:
    """Variance of the Laplacian (Pech-Pacheco et al., ICPR 2000), over the variance of grey: light does not matter."""
    import cv2

    grey = _grey(image)
    return float(cv2.Laplacian(grey, cv2.CV_64F).var() / max(float(grey.var()), 1.0))


def thumbnail(image: UInt8Array) -> Float64Array:
    """A few grey pixels, for comparing."""
    import cv2

    return np.asarray(cv2.resize(_grey(image), _THUMB, interpolation=cv2.INTER_AREA), dtype=np.float64)


def proposals(
    names: list[str], sharpnesses: list[float], thumbnails: list[Float64Array], judging: Judging = Judging()
) -> list[Proposal]:
    """What to leave out of one camera's pictures in one log."""
    found: list[Proposal] = []
    middle = float(np.median(sharpnesses)) if sharpnesses else 1.0
    kept: Float64Array | None = None
    for name, sharp, thumb in zip(names, sharpnesses, thumbnails, strict=True):
        relative = sharp / max(middle, 1e-12)
        if relative < judging.blurred:
            found.append(Proposal(name, "blurred", round(relative, 3)))
            continue
        change = float(np.abs(thumb - kept).mean()) if kept is not None else np.inf
        if change < judging.duplicate:
            found.append(Proposal(name, "duplicate", round(change, 2)))
            continue
        kept = thumb
    return found


def drop_list(found: Iterable[Proposal]) -> str:
    """CSV to edit: `no` keeps a picture, a further line with `yes` drops one more."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_HEADER)
    writer.writerows((p.name, "yes", p.reason, f"{p.number:g}") for p in found)
    return text.getvalue()


def read_drop_list(path: Path, names: Iterable[str]) -> Mapping[str, str]:
    """Reason by name of what is to be dropped.

    Raises:
        DatasetError: it cannot be read, has other columns, or names a picture that is not there (file:line).
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"cannot read the drop list: {error}", where=path, hint="make one with --review") from error
    if not rows or tuple(rows[0]) != _HEADER:
        raise DatasetError("is no drop list", where=path, hint=f"its first line is {','.join(_HEADER)}")
    known = set(names)
    found = {}
    for line, row in enumerate(rows[1:], start=2):
        if not any(row):
            continue
        name, drop, reason = (*row, "", "", "")[:3]
        if name not in known:
            near = [one for one in known if one.rpartition("_")[0] == name.rpartition("_")[0]]
            hint = closest(name, sorted(near or known)[:20]) if known else "there are no pictures"
            raise DatasetError(f"names '{name}', which is not among the pictures", where=f"{path}:{line}", hint=hint)
        if drop.strip().lower() not in _WORDS:
            raise DatasetError(f"drop is '{drop}'", where=f"{path}:{line}", hint="yes or no")
        if _WORDS[drop.strip().lower()]:
            found[name] = reason or "by hand"
    return found


def _grey(image: UInt8Array) -> UInt8Array:
    import cv2

    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
