"""Beams and faces -> for every element: how much of it was seen, how much was seen through, and how far it is off."""

from __future__ import annotations

import numpy as np

from wallkit.core.types import BoolArray, Float64Array, Int64Array
from wallkit.maps.audit.beams import pieces_of
from wallkit.maps.audit.faces import Faces
from wallkit.maps.audit.nouns import ElementEvidence, Logged, Pieces, Shift
from wallkit.maps.audit.solve import FLOOR_M, Solution, places_of

# a piece of wall is looked at when so many views had beams on it
VIEWS_MIN = 3
# and is not there when fewer of them had returns from it
SUPPORT_MIN = 0.25
_OPPOSITE = np.cos(np.deg2rad(179.0))


def is_on_face(faces: Faces, logged: Logged, solution: Solution, *, tolerance_m: float) -> BoolArray:
    """(B,) returns from the face they are taken for, wherever that face is now."""
    beams = solution.beams
    face = np.where(beams.segment >= 0, faces.faces[beams.segment], 0)
    off = np.abs(beams.offset_m - solution.offsets_m[face])
    return np.asarray(np.isfinite(logged.ranges_m) & (beams.segment >= 0) & (off <= tolerance_m))


def pieces_seen(faces: Faces, logged: Logged, solution: Solution, on_face: BoolArray, *, tolerance_m: float) -> Pieces:
    """How many views saw each piece of the outline, and how many saw through it."""
    beams, count = solution.beams, len(faces.pieces)
    hits = on_face & beams.is_steady
    hit_piece = pieces_of(faces, np.maximum(beams.segment, 0), beams.endpoints)
    asked = (beams.first >= 0) & beams.is_inner & beams.is_clear
    first_face = np.where(beams.first >= 0, faces.faces[beams.first], 0)
    beyond = -np.sum((beams.endpoints - faces.segments[beams.first, :2]) * faces.normals[beams.first], axis=1)
    beyond += solution.offsets_m[first_face]
    through = asked & (beyond > tolerance_m) & ~(on_face & (beams.segment == beams.first))
    at_first = beams.origins + np.where(np.isfinite(beams.first_m), beams.first_m, 0.0)[:, None] * beams.directions
    through_piece = pieces_of(faces, np.maximum(beams.first, 0), at_first)
    return Pieces(
        segments=faces.pieces,
        links=tuple(faces.names[link] for link in faces.links[faces.piece_segments]),
        is_exposed=faces.is_exposed,
        hits=_views_per_piece(hit_piece[hits], logged.views[hits], count),
        through=_views_per_piece(through_piece[through], logged.views[through], count),
    )


def elements_seen(faces: Faces, solution: Solution, pieces: Pieces) -> dict[str, ElementEvidence]:
    """The evidence on every link that the LiDAR could see."""
    of_piece = faces.links[faces.piece_segments]
    lengths = np.hypot(*(pieces.segments[:, 2:] - pieces.segments[:, :2]).T)
    middles = (pieces.segments[:, :2] + pieces.segments[:, 2:]) / 2
    looks = pieces.hits + pieces.through
    observed = pieces.is_exposed & (looks >= VIEWS_MIN)
    unsupported = observed & (pieces.hits < SUPPORT_MIN * looks)
    found = {}
    for number, name in enumerate(faces.names):
        own = (of_piece == number) & pieces.is_exposed
        if not own.any():
            continue
        missing = own & unsupported
        shown = missing if missing.any() else own
        x, y = np.average(middles[shown], axis=0, weights=lengths[shown])
        found[name] = ElementEvidence(
            link=name,
            length_m=float(lengths[own].sum()),
            observed_m=float(lengths[own & observed].sum()),
            unsupported_m=float(lengths[missing].sum()),
            views=int(looks[own].max()),
            places=int(solution.seen_from[faces.face_links == number].max(initial=0)),
            through=int(pieces.through[own].max()),
            at=(float(x), float(y)),
            shifts=tuple(_shifts(faces, solution, number)),
        )
    return found


def places_seen(solution: Solution) -> int:
    """From how many separate places the log looked."""
    return len(np.unique(places_of(solution.poses)))


# -------------------------------------------------------------------------------------------- details


def _shifts(faces: Faces, solution: Solution, link: int) -> list[Shift]:
    """One for each direction: two faces that look opposite ways tell of one shift, and of the thickness."""
    own = np.flatnonzero((faces.face_links == link) & (solution.seen_from > 0))
    own = own[np.argsort(-faces.face_lengths[own], kind="stable")]
    done: set[int] = set()
    found = []
    for face in own.tolist():
        if face in done:
            continue
        normal = faces.face_normals[face]
        alike = [f for f in own.tolist() if f not in done and abs(normal @ faces.face_normals[f]) >= -_OPPOSITE]
        done.update(alike)
        signs = np.array([1.0 if normal @ faces.face_normals[f] > 0 else -1.0 for f in alike])
        found.append(_shift_of(faces, solution, np.array(alike), signs, normal))
    return found


def _shift_of(faces: Faces, solution: Solution, alike: Int64Array, signs: Float64Array, normal: Float64Array) -> Shift:
    """The mean offset of parallel faces, weighted by their length, and how much farther apart they are than drawn."""
    covariance = solution.covariance[np.ix_(alike, alike)]
    share = faces.face_lengths[alike] / faces.face_lengths[alike].sum()
    sides = [signs > 0, signs < 0]
    both = all(side.any() for side in sides)
    if both:
        # each side counts half, or a corner that hides one of them would turn thickness into a shift
        share = sum(np.where(side, share / share[side].sum(), 0.0) / 2 for side in sides)
    apart = 2 * share
    return Shift(
        normal=(float(normal[0]), float(normal[1])),
        offset_m=float((share * signs) @ solution.offsets_m[alike]),
        sd_m=float(np.hypot(np.sqrt((share * signs) @ covariance @ (share * signs)), FLOOR_M)),
        places=int(solution.seen_from[alike].max()),
        thicker_m=float(apart @ solution.offsets_m[alike]) if both else np.nan,
        thicker_sd_m=float(np.sqrt(apart @ covariance @ apart)) if both else np.nan,
    )


def _views_per_piece(pieces: Int64Array, views: Int64Array, count: int) -> Int64Array:
    """How many different views (P,) each piece occurs with."""
    pairs = np.unique(np.column_stack([pieces, views]), axis=0)
    return np.bincount(pairs[:, 0], minlength=count).astype(np.int64)
