"""A semantic map and a height -> the faces that beams can meet, with their links, and what must be asked of a beam.

Doors are not among them: they stand now here, now there, and are looked at by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.geometry import parts, slice_parts
from wallkit.maps.model import SemanticMap
from wallkit.maps.sight import Sight, index_segments
from wallkit.maps.space import PASSAGE_M
from wallkit.maps.surfaces import floor_at, p_return_of

# what answers at least every other time stops beams; the rest (glass, mirrors) is looked through
STOPS_FROM = 0.5
PIECE_M = 0.25
_SAME_ANGLE = np.cos(np.deg2rad(0.5))
_SAME_LINE_M = 0.005


@dataclass(frozen=True, eq=False)
class Faces:
    """What stands at one height, but for doors.

    Attributes:
        z_m: the height.
        segments: (S, 4) edges of everything solid [m]. normals: (S, 2) outward unit vectors. links: (S,) index in `names`.
        faces: (S,) number of the straight face a segment is part of; segments of one link in one line are one face.
        face_links, face_normals, face_points, face_lengths: (F,), (F, 2), (F, 2), (F,) of each face.
        solid: what stops beams. clear: what they may pass or be mirrored by. everything: both.
        first_piece, piece_counts: (S,) the pieces of each segment. pieces: (P, 4). piece_segments: (P,).
        is_exposed: (P,) pieces that can be seen from the floor.
    """

    z_m: float
    names: tuple[str, ...]
    segments: Float64Array
    normals: Float64Array
    links: Int64Array
    faces: Int64Array
    face_links: Int64Array
    face_normals: Float64Array
    face_points: Float64Array
    face_lengths: Float64Array
    solid: Sight
    clear: Sight
    everything: Sight
    first_piece: Int64Array
    piece_counts: Int64Array
    pieces: Float64Array
    piece_segments: Int64Array
    is_exposed: BoolArray


def faces_at(semantic_map: SemanticMap, z_m: float) -> Faces:
    """The faces of a sound map at a height.

    Raises:
        MapError: the plane cuts nothing.
    """
    floor = floor_at(semantic_map, z_m)
    leaves = {link for joint in semantic_map.doors for link in semantic_map.subtree(joint.child)}
    cut = slice_parts([part for part in parts(semantic_map) if part.link not in leaves], z_m)
    segments = cut.segments if cut.polygons else np.zeros((0, 4))
    owners = cut.owners if cut.polygons else []
    names = tuple(dict.fromkeys(owners))
    links = np.array([names.index(owner) for owner in owners], dtype=np.int64)
    centres = np.array([cut.polygons[part].centroid.coords[0] for part in cut.part_of_segment]).reshape(-1, 2)
    normals = _outward(segments, centres)
    faces, representatives = _grouped(segments, normals, links)
    p_return = np.array([p_return_of(semantic_map.class_of(name)) for name in names])[links]
    first, counts, pieces, of_segment = _pieces(segments)
    beside = (pieces[:, :2] + pieces[:, 2:]) / 2 + normals[of_segment] * PASSAGE_M / 2
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    return Faces(
        z_m=z_m,
        names=names,
        segments=segments,
        normals=normals,
        links=links,
        faces=faces,
        face_links=links[representatives],
        face_normals=normals[representatives],
        face_points=segments[representatives, :2],
        face_lengths=np.bincount(faces, lengths, minlength=len(representatives)).astype(np.float64),
        solid=index_segments(segments, seen=p_return >= STOPS_FROM),
        clear=index_segments(segments, seen=p_return < STOPS_FROM),
        everything=index_segments(segments),
        first_piece=first,
        piece_counts=counts,
        pieces=pieces,
        piece_segments=of_segment,
        is_exposed=floor.holds(beside) & (p_return >= STOPS_FROM)[of_segment],
    )


def _outward(segments: Float64Array, centres: Float64Array) -> Float64Array:
    """Unit normals (S, 2) that point away from the middle of the convex solid each edge belongs to."""
    along = segments[:, 2:] - segments[:, :2]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    inward = np.sum(normals * (segments[:, :2] - centres), axis=1) < 0
    return np.asarray(np.where(inward[:, None], -normals, normals))


def _grouped(segments: Float64Array, normals: Float64Array, links: Int64Array) -> tuple[Int64Array, Int64Array]:
    """Number of the face (S,) of every segment, and a segment (F,) of every face."""
    by_link: dict[int, list[int]] = {}
    faces = np.empty(len(segments), dtype=np.int64)
    representatives: list[int] = []
    for s, link in enumerate(links.tolist()):
        for face in by_link.setdefault(link, []):
            r = representatives[face]
            off = normals[r] @ (segments[s, :2] - segments[r, :2])
            if normals[r] @ normals[s] >= _SAME_ANGLE and abs(off) <= _SAME_LINE_M:
                faces[s] = face
                break
        else:
            faces[s] = len(representatives)
            by_link[link].append(len(representatives))
            representatives.append(s)
    return faces, np.array(representatives, dtype=np.int64)


def _pieces(segments: Float64Array) -> tuple[Int64Array, Int64Array, Float64Array, Int64Array]:
    """First piece and number of pieces (S,) of every segment, the pieces (P, 4), and the segment (P,) of each."""
    lengths = np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    counts = np.maximum(np.round(lengths / PIECE_M), 1).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)[: len(counts)]
    of_segment = np.repeat(np.arange(len(segments)), counts)
    start = (np.arange(len(of_segment)) - first[of_segment]) / counts[of_segment]
    end = start + 1 / counts[of_segment]
    low, along = segments[of_segment, :2], (segments[:, 2:] - segments[:, :2])[of_segment]
    return first, counts, np.hstack([low + start[:, None] * along, low + end[:, None] * along]), of_segment
