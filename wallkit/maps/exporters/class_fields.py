"""A semantic map at one height -> a distance field per class.

fields.npz is to compute with, the PNGs are to look at, and fields.json says what each is.
"""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

import wallkit
from wallkit.core.types import FieldSet, Float32Array
from wallkit.errors import MapError
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, height_of
from wallkit.maps.grids.semantic_fields import SIGMA_M, fields_from_map
from wallkit.maps.model import SemanticMap
from wallkit.maps.surfaces import p_return_of

CELL_M = 0.025
# a step of grey: white is GREY_M * 255 = 2.55 m or farther
GREY_M = 0.01
WHAT = (
    "distance in metres (float32) from a cell's centre to the nearest surface of the class that free space sees; row 0 is "
    "the lowest y, column 0 the lowest x. Surfaces that may not answer seem farther: a probability p counts as "
    "sqrt(d^2 + 2 sigma_m^2 ln(1 / p))"
)


def export_fields(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """A folder: fields.npz (an array per class, `all`, `is_free`), CLASS.png, fields.json.

    Raises:
        MapError: no height is known, nothing is seen there, or there are too many cells.
    """
    import cv2

    notes = Notes(semantic_map.source, "distance fields")
    z_m, cell_m = height_of(semantic_map, options), options.cell_m or CELL_M
    fields = fields_from_map(semantic_map, cell_m=cell_m, scan_plane_m=z_m).fields
    names = _file_names(fields)
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **dict(fields.distances_m), is_free=fields.is_free)
    files = {out / "fields.npz": packed.getvalue()}
    for name, field in fields.distances_m.items():
        is_encoded, png = cv2.imencode(".png", _greys(field))
        if not is_encoded:
            raise MapError(f"the picture of '{name}' cannot be encoded", where=out)
        files[out / names[name]] = png.tobytes()
    document = _document(semantic_map, fields, z_m, names)
    files[out / "fields.json"] = (json.dumps(document, indent=2, allow_nan=False) + "\n").encode()
    rows, columns = fields.shape
    notes.wrote(f"{len(names)} fields of {columns} x {rows} cells of {cell_m:g} m at {z_m:g} m: {', '.join(names)}")
    unseen = {link.class_name for link in semantic_map.links.values() if link.class_name} - set(names)
    if unseen:
        notes.taken(f"classes that nothing of is seen at {z_m:g} m have no field: {', '.join(sorted(unseen))}")
    return Exported(files, notes.all())


def _file_names(fields: FieldSet) -> dict[str, str]:
    """File name by class; a class called `all` or `is_free` would hide what those names mean."""
    for name in fields.distances_m:
        if name == "is_free":
            raise MapError(
                "a class is called 'is_free', the name of the free cells", where=fields.source, hint="rename it"
            )
    return {name: f"{name}.png" for name in fields.distances_m}


def _greys(field: Float32Array) -> np.ndarray:
    """Grey 8 bit, row 0 at the top: black on the surface, white far away."""
    return np.asarray(np.minimum(np.rint(field[::-1] / GREY_M), 255), dtype=np.uint8)


def _document(semantic_map: SemanticMap, fields: FieldSet, z_m: float, names: dict[str, str]) -> dict[str, Any]:
    info_of = semantic_map.classes.get
    return {
        "schema": 1,
        "wallkit": wallkit.__version__,
        "map": Path(semantic_map.source).name,
        "map_sha256": hashlib.sha256(semantic_map.document.data).hexdigest(),
        "what": WHAT,
        "z_m": z_m,
        "resolution_m": fields.resolution_m,
        "origin": [float(value) for value in fields.origin],
        "shape": list(fields.shape),
        "sigma_m": SIGMA_M,
        "png_m_per_grey": GREY_M,
        "is_free": "bool, cells a robot may be on",
        "fields": {
            name: {
                "png": file,
                "seg": list(info.seg) if (info := info_of(name)) else [],
                "lidar": info.lidar if info else None,
                "p_return": p_return_of(info) if name != "all" else None,
                "movable": info.movable if info else None,
                "weighs": "how likely a surface is there and answers" if name == "all" else "how likely it is there",
            }
            for name, file in names.items()
        },
    }
