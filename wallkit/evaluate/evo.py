"""An error series -> a result file that `evo_res` reads, without evo."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array, Int64Array
from wallkit.errors import OutputError, WallkitError, closest
from wallkit.evaluate.associate import Pairs
from wallkit.evaluate.metrics import SERIES, Series, rmse


def write_evo_zip(
    path: Path, pairs: Pairs, series: str, *, estimate_name: str = "estimate", truth_name: str = "truth"
) -> None:
    """Writes one error series of `SERIES` as an evo result; the same pairs give the same bytes.

    Raises:
        WallkitError: no such series, or these pairs do not have it.
        OutputError: the file cannot be written.
    """
    data = evo_zip(pairs, series, estimate_name=estimate_name, truth_name=truth_name)
    try:
        path.write_bytes(data)
    except OSError as error:
        raise OutputError(f"cannot write the evo result: {error}", where=path, hint="choose another --out") from error


def evo_zip(pairs: Pairs, series: str, *, estimate_name: str = "estimate", truth_name: str = "truth") -> bytes:
    """The bytes of that file: info.json, stats.json and the arrays evo plots.

    Raises:
        WallkitError: no such series, or these pairs do not have it.
    """
    if series not in SERIES:
        raise WallkitError(f"no error series is called '{series}'", hint=closest(series, SERIES))
    found = SERIES[series](pairs)
    if found is None:
        raise WallkitError(f"the run has no '{series}': the robot hardly moved", hint="export another series")
    label = f"{'RPE' if series.startswith('rpe') else 'APE'} ({found.unit})"
    info = {"title": f"{series} ({found.unit})", "ref_name": truth_name, "est_name": estimate_name, "label": label}
    entries = {
        "info.json": json.dumps(info).encode(),
        "stats.json": json.dumps(_statistics(found.errors), allow_nan=False).encode(),
        **{f"{name}.npy": _npy(array) for name, array in _arrays(pairs, found).items()},
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            # a ZipInfo of its own has a fixed date; writestr(name) would store the clock
            archive.writestr(zipfile.ZipInfo(name), data, compress_type=zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _statistics(errors: Float64Array) -> dict[str, float]:
    return {
        "rmse": rmse(errors),
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "std": float(errors.std()),
        "min": float(errors.min()),
        "max": float(errors.max()),
        "sse": float((errors**2).sum()),
    }


def _arrays(pairs: Pairs, series: Series) -> dict[str, Float64Array]:
    """The error and where along the run it was taken; distances are of the truth and of the estimate."""
    seconds = (pairs.stamps_ns - pairs.stamps_ns[0]) / 1e9
    return {
        "error_array": series.errors,
        "seconds_from_start": seconds[series.at],
        "timestamps": (pairs.stamps_ns / 1e9)[series.at],
        "distances_from_start": _travelled(pairs.truth, series.at),
        "distances": _travelled(pairs.estimate, series.at),
    }


def _travelled(poses: Float64Array, rows: Int64Array) -> Float64Array:
    """Distance from the first pose to each of the rows, straight from row to row as evo counts it."""
    places = poses[np.union1d([0], rows), :2]
    steps = np.hypot(*np.diff(places, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])[-len(rows) :]


def _npy(array: Float64Array) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()
