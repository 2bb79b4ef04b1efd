"""A semantic map at one height -> the raster of map_server: a PGM and its YAML.

Occupied are the cells of what stands there, as far as free space can see them: a filter that scores against a wall's inside
draws endpoints into it (Beluga #265). Free is the floor a robot may be on; all else is unknown.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wallkit.core.types import BoolArray, Float64Array
from wallkit.errors import MapError
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes, height_of, lose_meaning
from wallkit.maps.geometry import Part, Slice, parts, slice_parts
from wallkit.maps.grids.fields import visible_surface
from wallkit.maps.grids.lattice import Lattice, lattice_around
from wallkit.maps.model import SemanticMap
from wallkit.maps.surfaces import door_alternatives, floor_at

if TYPE_CHECKING:
    from shapely import Polygon

# map_saver's greys and thresholds (nav2_map_server, map_io.cpp); they read back as written in every mode of map_server
OCCUPIED_GREY, FREE_GREY, UNKNOWN_GREY = 0, 254, 205
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
CELL_M = 0.05
MARGIN_M = 1.0
# raw mode: up to 100 a pixel is the occupancy in per cent, above it is unknown
RAW_UNKNOWN = 255


def export_pgm(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """PATH.yaml and PATH.pgm.

    With doors "prior" a leaf's cells hold the probability that it is there, and the mode is raw, which keeps them.

    Raises:
        MapError: no height is known, nothing is cut there, or there are too many cells.
    """
    notes = Notes(semantic_map.source, "a map_server raster")
    z_m, doors = height_of(semantic_map, options), options.doors or "closed"
    floor = floor_at(semantic_map, z_m)
    ends = floor.cut.segments.reshape(-1, 2)
    cell_m = options.cell_m or CELL_M
    lattice = lattice_around(ends, cell_m, margin_m=MARGIN_M, source=semantic_map.source, flag="--resolution ")
    leaves = {link for joint in semantic_map.doors for link in semantic_map.subtree(joint.child)}
    standing = slice_parts([part for part in parts(semantic_map) if part.link not in leaves], z_m)
    solid = _cells_of(standing, lattice)
    # where a closed leaf stood there is floor once it is gone
    closed = [p for part, p in zip(floor.cut.parts, floor.cut.polygons, strict=True) if part.link in leaves]
    free = (lattice.floor(floor) | lattice.drawn(closed)) & ~solid
    if doors == "prior":
        there = _leaf_probabilities(semantic_map, lattice, leaves, z_m)
    else:
        states = semantic_map.door_states(doors)
        there = _drawn_at(semantic_map, lattice, leaves, states, z_m).astype(np.float64)
    occupied = solid if options.is_solid else visible_surface(solid, free, cell_m) if solid.any() else solid
    percent = np.where(occupied, 100, np.where(free, 0, -1))
    percent = np.where((there > 0) & ~solid, np.rint(100 * there).astype(int), percent)
    if not (percent >= 0).any():
        raise MapError(
            "nothing of it would be free or occupied", where=semantic_map.source, hint="wallkit map validate"
        )
    is_raw = bool(((percent > 0) & (percent < 100)).any())
    yaml, image = out.with_suffix(".yaml"), out.with_suffix(".pgm")
    notes.wrote(
        f"{lattice.columns} x {lattice.rows} cells of {cell_m:g} m at {z_m:g} m: {(percent == 0).sum():,} free, "
        f"{(percent > 0).sum():,} occupied{' or perhaps' if is_raw else ''}; doors: {doors}",
        free=int((percent == 0).sum()),
        occupied=int((percent > 0).sum()),
    )
    _say_lost(notes, semantic_map, {part.link for part in standing.parts} | leaves, z_m, is_prior=doors == "prior")
    files = {yaml: _yaml(image.name, lattice, is_raw=is_raw), image: _pgm(percent, is_raw=is_raw)}
    return Exported(files, notes.all())


def _drawn_at(
    semantic_map: SemanticMap, lattice: Lattice, links: set[str], states: Mapping[str, float], z_m: float
) -> BoolArray:
    """The cells (H, W) that some links touch at joint states."""
    poses = semantic_map.poses(states)
    moved: list[Part] = parts(semantic_map, poses={link: T for link, T in poses.items() if link in links})
    return _cells_of(slice_parts(moved, z_m), lattice)


def _cells_of(cut: Slice, lattice: Lattice) -> BoolArray:
    """The cells (H, W) whose centre is in a slice, and a line of them along all that is thinner than a cell.

    Drawing takes every cell that an outline passes through, which would put faces half a cell too far out.
    """
    import shapely

    inset_m = lattice.cell_m / 2
    inside = shapely.get_parts(shapely.buffer(cut.solid, -inset_m, join_style="mitre"))
    thin = [polygon for polygon in cut.polygons if shapely.buffer(polygon, -inset_m, join_style="mitre").is_empty]
    return lattice.drawn([polygon for polygon in (*inside, *map(_middle_of, thin)) if not polygon.is_empty])


def _middle_of(thin: Polygon) -> Polygon:
    """What is left of a thin convex polygon along its middle."""
    corners = np.array(thin.minimum_rotated_rectangle.exterior.coords)
    thickness_m = float(np.hypot(*np.diff(corners[:3], axis=0).T).min())
    left = thin.buffer(-0.499 * thickness_m, join_style="mitre")
    return left if left.geom_type == "Polygon" and not left.is_empty else thin


def _leaf_probabilities(semantic_map: SemanticMap, lattice: Lattice, leaves: set[str], z_m: float) -> Float64Array:
    """(H, W) probability that some leaf is on a cell; doors are independent, the states of one exclude each other."""
    nothing_there = np.ones((lattice.rows, lattice.columns))
    for joint in semantic_map.doors:
        if joint.mimic is not None:
            continue
        own = _moved_by(semantic_map, joint.name) & leaves
        there = np.zeros_like(nothing_there)
        for state, probability in door_alternatives(joint).items():
            there += probability * _drawn_at(semantic_map, lattice, own, {joint.name: state}, z_m)
        nothing_there *= 1.0 - np.minimum(there, 1.0)
    return np.asarray(1.0 - nothing_there)


def _moved_by(semantic_map: SemanticMap, leader: str) -> set[str]:
    """Links that move with a joint, those of joints that follow it included."""
    moving, found = [leader], set[str]()
    while moving:
        name = moving.pop()
        found.update(semantic_map.subtree(semantic_map.joints[name].child))
        moving += [joint.name for joint in semantic_map.doors if joint.mimic and joint.mimic.joint == name]
    return found


def _yaml(image: str, lattice: Lattice, *, is_raw: bool) -> bytes:
    lines = [
        f"image: {json.dumps(image)}",
        f"mode: {'raw' if is_raw else 'trinary'}",
        f"resolution: {lattice.cell_m:.9g}",
        f"origin: [{lattice.low[0]:.9g}, {lattice.low[1]:.9g}, 0]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED_THRESH}",
        f"free_thresh: {FREE_THRESH}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _pgm(percent: np.ndarray, *, is_raw: bool) -> bytes:
    """The image, its first row at the top."""
    if is_raw:
        grey = np.where(percent < 0, RAW_UNKNOWN, percent)
    else:
        grey = np.where(percent < 0, UNKNOWN_GREY, np.where(percent > 0, OCCUPIED_GREY, FREE_GREY))
    rows, columns = percent.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + grey[::-1].astype(np.uint8).tobytes()


def _say_lost(notes: Notes, semantic_map: SemanticMap, cut: set[str], z_m: float, *, is_prior: bool) -> None:
    behaviours = {name: info.lidar for name in cut if (info := semantic_map.class_of(name)) and info.lidar != "opaque"}
    if behaviours:
        listed = ", ".join(f"{list(behaviours.values()).count(b)} {b}" for b in sorted(set(behaviours.values())))
        notes.taken(f"what a LiDAR sees through or falsely is occupied too: {listed}")
    meshes = sum(shape.kind == "mesh" for link in semantic_map.links.values() for shape in link.shapes)
    missed = {part.link for part in parts(semantic_map)} - cut
    notes.lose(f"element above or below {z_m:g} m", len(missed), many=f"elements above or below {z_m:g} m")
    notes.lose("mesh", meshes, many="meshes")
    lose_meaning(notes, semantic_map, but={"declared opening", "prior"} if is_prior else {"declared opening"})
