"""A planar LiDAR on a moving robot in a scene -> sweeps as it would record them, and what every return truly came from.

What a real one does wrong is modelled one by one: noise that grows with range and with grazing incidence, lost returns,
spots that fall on two surfaces at once, glass that lets most beams through, mirrors that show a second room behind them, a
plane that is not quite level, and a sweep that takes time while everything moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array, Int64Array, PointCloud, Scan
from wallkit.simulate.scene import NOTHING, Hits, Scene

PoseAt = Callable[[int], Float64Array]
# a beam is followed through so many mirrors
_BOUNCES = 2
_OFF_SURFACE_M = 1e-4


@dataclass(frozen=True)
class Scanner:
    """A planar LiDAR and its faults; all zero but the first seven: a perfect one."""

    beams: int = setting(1080, "beams of a sweep", low=2, high=20000)
    fov_rad: float = setting(4.71239, "field of view, symmetric about the LiDAR's x axis", low=0.01, high=6.2832)
    rate_hz: float = setting(10.0, "sweeps per second", low=0.1, high=200)
    range_min_m: float = setting(0.06, "nearer returns are not reported", low=0)
    range_max_m: float = setting(15.0, "farther returns are not reported", low=0.1)
    is_instant: bool = setting(False, "the whole sweep at one moment, instead of beam after beam")
    sectors: int = setting(12, "pieces a sweep is cast in, each from where everything is then", low=1, high=720)
    sigma_m: float = setting(0.01, "noise of a range at perpendicular incidence", low=0)
    sigma_per_m: float = setting(0.002, "noise that is added per metre of range", low=0)
    grazing: float = setting(0.5, "share of noise that is added per (1 / cos(incidence) - 1)", low=0)
    bias_m: float = setting(0.0, "added to every range")
    quantum_m: float = setting(0.001, "ranges are multiples of it; 0: of nothing", low=0)
    dropout: float = setting(0.002, "share of returns that are lost at random", low=0, high=1)
    grazing_dropout: float = setting(0.5, "share lost at grazing incidence: times (1 - cos)^6", low=0, high=1)
    divergence_rad: float = setting(0.003, "width of a beam; 0: a line", low=0, high=0.1)
    mixed_m: float = setting(0.1, "a spot on two surfaces farther apart gives a range between them", low=0)
    ghosts: float = setting(1.0, "share of beams on a mirror that come back from what it shows", low=0, high=1)

    @property
    def bearings_rad(self) -> Float64Array:
        """(K,) bearings of the beams in the LiDAR's frame."""
        return np.linspace(-self.fov_rad / 2, self.fov_rad / 2, self.beams)

    @property
    def beam_interval_s(self) -> float:
        """Time between two beams: the mirror also turns where it does not look."""
        return 0.0 if self.is_instant else self.fov_rad / (2 * np.pi) / self.rate_hz / self.beams


@dataclass(frozen=True)
class Rings:
    """What makes a planar LiDAR a 3-D one: the same beams in several rings, evenly spread up and down."""

    count: int = setting(16, "rings", low=2, high=256)
    span_rad: float = setting(0.5236, "from the lowest ring to the highest", low=0.01, high=3.0)

    @property
    def elevations_rad(self) -> Float64Array:
        """(R,) above the LiDAR's x-y plane, the lowest first."""
        return np.linspace(-self.span_rad / 2, self.span_rad / 2, self.count)


def perfect(scanner: Scanner) -> Scanner:
    """The same LiDAR without any fault: what it measures is the distance."""
    from dataclasses import replace

    exact = replace(scanner, sigma_m=0.0, sigma_per_m=0.0, grazing=0.0, bias_m=0.0, quantum_m=0.0)
    return replace(exact, dropout=0.0, grazing_dropout=0.0, divergence_rad=0.0)


@dataclass(frozen=True, eq=False)
class Sweep:
    """One sweep and its truth.

    Attributes:
        solids: (K,) the world's solid each return came from: of a mirror image the mirror; NOTHING for no return, and for a
            spot between two surfaces, which is on none.
    """

    scan: Scan
    solids: Int64Array


def sweep(
    rng: np.random.Generator,
    scanner: Scanner,
    scene: Scene,
    stamp_ns: int,
    T_map_lidar_at: PoseAt,
    *,
    place_at: Callable[[int], None] | None = None,
    frame_id: str = "laser",
) -> Sweep:
    """One sweep that begins at a stamp.

    Args:
        T_map_lidar_at: (4, 4) of the LiDAR at a time [ns].
        place_at: puts everything else that moves where it is at a time; None: nothing moves.
    """
    bearings = scanner.bearings_rad
    times_ns = stamp_ns + np.round(np.arange(scanner.beams) * scanner.beam_interval_s * 1e9).astype(np.int64)
    ranges, cosines = np.empty(scanner.beams), np.empty(scanner.beams)
    solids = np.empty(scanner.beams, dtype=np.int64)
    pieces = np.array_split(np.arange(scanner.beams), 1 if scanner.is_instant else min(scanner.sectors, scanner.beams))
    for piece in pieces:
        middle_ns = int(times_ns[piece[len(piece) // 2]])
        if place_at is not None:
            place_at(middle_ns)
        T = T_map_lidar_at(middle_ns)
        ranges[piece], solids[piece], cosines[piece] = _spots(rng, scanner, scene, T, bearings[piece])
    measured = _measured(rng, scanner, ranges, cosines)
    scan = Scan(
        stamp_ns,
        frame_id,
        measured.astype(np.float32),
        bearings.astype(np.float32),
        scanner.beam_interval_s,
        scanner.range_min_m,
        scanner.range_max_m,
    )
    return Sweep(scan, np.where(np.isfinite(measured), solids, NOTHING))


def cloud(
    rng: np.random.Generator,
    scanner: Scanner,
    rings: Rings,
    scene: Scene,
    stamp_ns: int,
    T_map_lidar: Float64Array,
    *,
    frame_id: str = "lidar",
) -> PointCloud:
    """The returns of a 3-D LiDAR that stands still while nothing moves, ring after ring."""
    bearings = scanner.bearings_rad
    points, numbers = [], []
    for ring, elevation in enumerate(rings.elevations_rad.tolist()):
        ranges, _, cosines = _spots(rng, scanner, scene, T_map_lidar, bearings, elevation)
        measured = _measured(rng, scanner, ranges, cosines)
        kept = np.isfinite(measured)
        points.append(measured[kept, None] * _directions(bearings[kept], elevation))
        numbers.append(np.full(int(kept.sum()), ring, dtype=np.int64))
    return PointCloud(stamp_ns, frame_id, np.concatenate(points).astype(np.float32), rings=np.concatenate(numbers))


# -------------------------------------------------------------------------------------------- light


def _spots(
    rng: np.random.Generator,
    scanner: Scanner,
    scene: Scene,
    T_map_lidar: Float64Array,
    bearings: Float64Array,
    elevation_rad: float = 0.0,
) -> tuple[Float64Array, Int64Array, Float64Array]:
    """(range, solid, cosine of incidence) of beams that are as wide as they are."""
    ranges, solids, cosines = _echoes(rng, scanner, scene, T_map_lidar, _directions(bearings, elevation_rad))
    if scanner.divergence_rad == 0:
        return ranges, solids, cosines
    edges = [
        _echoes(
            rng, scanner, scene, T_map_lidar, _directions(bearings + side * scanner.divergence_rad / 2, elevation_rad)
        )[0]
        for side in (-1.0, 1.0)
    ]
    both = np.stack([ranges, *edges])
    near, far = both.min(axis=0), both.max(axis=0)
    with np.errstate(invalid="ignore"):
        is_mixed = np.isfinite(far) & (far - near > scanner.mixed_m) & (cosines > 0.2)
    # where the energy is divided the range lies anywhere between; half of the time one surface wins
    is_mixed &= rng.random(len(bearings)) < 0.5
    share = rng.random(len(bearings))
    between = ranges.copy()
    between[is_mixed] = near[is_mixed] + share[is_mixed] * (far[is_mixed] - near[is_mixed])
    return between, np.where(is_mixed, NOTHING, solids), cosines


def _directions(bearings: Float64Array, elevation_rad: float) -> Float64Array:
    """(K, 3) unit, in the LiDAR's frame."""
    flat = np.cos(elevation_rad)
    return np.column_stack(
        [flat * np.cos(bearings), flat * np.sin(bearings), np.full(len(bearings), np.sin(elevation_rad))]
    )


def _echoes(
    rng: np.random.Generator, scanner: Scanner, scene: Scene, T_map_lidar: Float64Array, directions: Float64Array
) -> tuple[Float64Array, Int64Array, Float64Array]:
    """(range, solid, cosine) of thin beams (K, 3): through glass that does not answer, and by mirrors."""
    R, origin = T_map_lidar[:3, :3], T_map_lidar[:3, 3]
    directions = directions @ R.T
    hits = scene.cast(origin, directions)
    lights = scene.lights[hits.solids]
    if (lights == "glass").any():
        hits, lights = _through_glass(rng, scene, origin, directions, hits, lights)
    cosines = np.abs(np.nan_to_num(np.sum(hits.normals * directions, axis=1)))
    ranges, solids = hits.ranges_m.copy(), hits.solids
    for beam in np.flatnonzero(lights == "mirror"):
        is_ghost = rng.random() < scanner.ghosts
        ranges[beam] = _by_mirror(scene, origin, directions[beam], hits, int(beam)) if is_ghost else np.inf
    return ranges, np.where(np.isfinite(ranges), solids, NOTHING), cosines


def _through_glass(
    rng: np.random.Generator,
    scene: Scene,
    origin: Float64Array,
    directions: Float64Array,
    hits: Hits,
    lights: np.ndarray,
) -> tuple[Hits, np.ndarray]:
    """Beams that glass does not answer go on to what is behind it, once; glass behind glass is looked through."""
    answers = scene.p_return[hits.solids]
    passes = (lights == "glass") & (rng.random(len(lights)) >= answers)
    behind = scene.cast(origin, directions[passes], unseen=("glass",))
    ranges, solids, normals = hits.ranges_m.copy(), hits.solids.copy(), hits.normals.copy()
    ranges[passes], solids[passes], normals[passes] = behind.ranges_m, behind.solids, behind.normals
    lights = scene.lights[solids]
    return Hits(ranges, solids, normals), lights


def _by_mirror(scene: Scene, origin: Float64Array, direction: Float64Array, hits: Hits, beam: int) -> float:
    """Length of the way by one or more mirrors to something that answers; inf where there is nothing."""
    travelled, normal = float(hits.ranges_m[beam]), hits.normals[beam]
    at = origin + travelled * direction
    for _ in range(_BOUNCES):
        direction = direction - 2 * np.dot(direction, normal) * normal
        seen = scene.cast(at + _OFF_SURFACE_M * direction, direction[None], unseen=("glass",))
        if seen.solids[0] == NOTHING:
            return np.inf
        step = float(seen.ranges_m[0]) + _OFF_SURFACE_M
        travelled += step
        if scene.world.solids[int(seen.solids[0])].light != "mirror":
            return travelled
        at, normal = at + step * direction, seen.normals[0]
    return np.inf


def _measured(rng: np.random.Generator, scanner: Scanner, ranges: Float64Array, cosines: Float64Array) -> Float64Array:
    """What the driver publishes of true ranges: NaN below its least, inf where nothing came back (REP 117)."""
    slant = np.minimum(1 / np.maximum(cosines, 1e-3) - 1, 5.0)
    near = np.where(np.isfinite(ranges), ranges, 0.0)
    sigma = (scanner.sigma_m + scanner.sigma_per_m * near) * (1 + scanner.grazing * slant)
    measured = ranges + scanner.bias_m + sigma * rng.standard_normal(len(ranges))
    lost = rng.random(len(ranges)) < scanner.dropout + scanner.grazing_dropout * (1 - np.minimum(cosines, 1)) ** 6
    measured = np.where(lost | (measured > scanner.range_max_m), np.inf, measured)
    if scanner.quantum_m > 0:
        finite = np.isfinite(measured)
        measured[finite] = np.round(measured[finite] / scanner.quantum_m) * scanner.quantum_m
    return np.where(measured < scanner.range_min_m, np.nan, measured)
