"""A scan and a guess -> the pose near it that explains the scan best, and how many beams it explains, on the segments.

A return is *explained* from a pose when the point it would end at lies within the tolerance of a surface and no surface
stands in its way, farther than the tolerance from that point. A beam without a return is explained when nothing is met up
to the tolerance before the range's end.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from wallkit.core.types import Float64Array, Int64Array
from wallkit.maps.score.nearness import Nearness
from wallkit.maps.sight import Sight, first_hit

_SLIDE_M = 0.12
_SLIDES = 24


class Criterion(NamedTuple):
    """What counts as a rival.

    Attributes:
        tolerance_m: see the module. range_max_m: longest beam.
        needed: beams that a rival explains.
        apart_m, apart_rad: a rival is farther than one of them.
    """

    tolerance_m: float
    range_max_m: float
    needed: int
    apart_m: float
    apart_rad: float


class Ground(NamedTuple):
    """What scans are matched to.

    Attributes:
        near, sight: of the surfaces that beams see. labels: (S,) of every segment.
        horizons: (rows, columns, SECTORS) uint8, see horizon. looked: (rows, columns) blocks whose horizon is known; both
            are filled as the search asks. profiles: see horizon.
    """

    near: Nearness
    horizons: Any
    looked: Any
    profiles: Any
    sight: Sight
    labels: Int64Array
    criterion: Criterion


class Beams(NamedTuple):
    """One scan.

    Attributes:
        bearings: (K,) from the heading. cosines, sines: of them. ranges: (K,) [m], inf without a return.
        wanted: (K,) label that the return must meet again, -1 for any.
    """

    bearings: Float64Array
    cosines: Float64Array
    sines: Float64Array
    ranges: Float64Array
    wanted: Int64Array


@njit(cache=True, nogil=True)
def count_explained(ground: Any, beams: Any, pose: Any, tolerance: Any, least: Any) -> Any:
    """Beams of a scan that a pose explains; -1 as soon as `least` is out of reach."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y, size = pose[0], pose[1], beams.ranges.shape[0]
    reach = ground.criterion.range_max_m - tolerance
    misses = 0
    for k in range(size):
        dx = c * beams.cosines[k] - s * beams.sines[k]
        dy = s * beams.cosines[k] + c * beams.sines[k]
        r = beams.ranges[k]
        if np.isinf(r):
            fits = first_hit(ground.sight, x, y, dx, dy, reach)[1] < 0
        else:
            ahead, met = first_hit(ground.sight, x, y, dx, dy, r + tolerance)
            fits = met >= 0 and ahead >= r - tolerance
            if fits and beams.wanted[k] >= 0:
                fits = ground.labels[met] == beams.wanted[k]
        if not fits:
            misses += 1
            if size - misses < least:
                return -1
    return size - misses


@njit(cache=True, nogil=True)
def settle(ground: Any, beams: Any, start: Any, iterations: Any, far_allowed: Any) -> Any:
    """(pose, whether it is any good): the pose moved so that returns lie on the surfaces nearest to them.

    Gauss-Newton with Geman & McClure's weights whose scale shrinks from 0.3 m to 5 cm: far returns count less and less.
    Slightly damped, so that a direction no beam sees stays where it is. Given up when more than `far_allowed` returns are
    still beyond three tolerances after half of the iterations.
    """
    pose = start.copy()
    scale = 0.3
    damping = 1e-4 * beams.ranges.shape[0]
    for iteration in range(iterations):
        H, g, arm, far = _normal_equations(ground, beams, pose, scale)
        if 2 * iteration >= iterations and far > far_allowed:
            return pose, False
        H[0, 0] += damping
        H[1, 1] += damping
        H[2, 2] += damping * arm * arm
        step = _solve(H, g)
        length = math.hypot(step[0], step[1])
        shrink = min(1.0, 0.2 / max(length, 1e-12), 0.1 / max(abs(step[2]), 1e-12))
        for a in range(3):
            pose[a] -= shrink * step[a]
        if length < 1e-4 and abs(step[2]) < 1e-4 and scale <= 0.06:
            break
        scale = max(0.6 * scale, 0.05)
    return pose, True


@njit(cache=True, nogil=True)
def polish(ground: Any, beams: Any, own: Any, pose: Any, explained: Any) -> Any:
    """Beams explained after small moves that explain more, as long as there are any; `pose` is moved along.

    Settling minimises distances, a rival is judged by a count: the best of one is within the tolerance of the other's. If
    not even twice the tolerance makes it a rival, no such move will.
    """
    criterion = ground.criterion
    if count_explained(ground, beams, pose, 2 * criterion.tolerance_m, criterion.needed) < 0:
        return explained
    trial = pose.copy()
    for size in (criterion.tolerance_m / 2, criterion.tolerance_m / 4):
        improved = True
        while improved and explained < criterion.needed:
            improved = False
            for move in range(6):
                axis, sign = move // 2, 1.0 - 2.0 * (move % 2)
                trial[:] = pose
                trial[axis] += sign * (size if axis < 2 else size / 3.0)
                if is_close(trial, own, criterion.apart_m, criterion.apart_rad) or not is_free(ground.near, trial):
                    continue
                more = count_explained(ground, beams, trial, criterion.tolerance_m, explained + 1)
                if more > explained:
                    pose[:] = trial
                    explained = more
                    improved = True
    return explained


@njit(cache=True, nogil=True)
def slide(ground: Any, beams: Any, own: Any) -> Any:
    """Whether small steps, each explaining enough, lead away from a pose: (beams explained there or 0, where).

    Steps follow the direction that the beams constrain least (the weakest eigenvector of the information matrix, headings
    weighed by the root mean square range), to either side; returns settle on the surfaces after each.
    """
    criterion, size = ground.criterion, beams.ranges.shape[0]
    for side in (1.0, -1.0):
        pose, travelled = own.copy(), 0.0
        direction = np.array([1.0, 0.7, 0.4])
        for _ in range(_SLIDES):
            H, _g, arm, _far = _normal_equations(ground, beams, pose, criterion.tolerance_m)
            direction = _weakest(H, arm, direction)
            pose[0] += side * _SLIDE_M * direction[0]
            pose[1] += side * _SLIDE_M * direction[1]
            pose[2] += side * _SLIDE_M * direction[2] / arm
            pose, good = settle(ground, beams, pose, 4, size - criterion.needed)
            away = math.hypot(pose[0] - own[0], pose[1] - own[1]) + arm * abs(pose[2] - own[2])
            # where beams do see the direction, settling goes back to where the step came from
            if not good or away < travelled + _SLIDE_M / 4 or not is_free(ground.near, pose):
                break
            travelled = away
            explained = count_explained(ground, beams, pose, criterion.tolerance_m, criterion.needed)
            if explained < 0:
                break
            if not is_close(pose, own, criterion.apart_m, criterion.apart_rad):
                return explained, pose
    return 0, own


@njit(cache=True, nogil=True)
def is_close(a: Any, b: Any, distance: Any, angle: Any) -> Any:
    """Whether two poses are within a distance and an angle of each other."""
    turn = a[2] - b[2]
    turn -= 2 * math.pi * math.floor(turn / (2 * math.pi) + 0.5)
    return math.hypot(a[0] - b[0], a[1] - b[1]) <= distance and abs(turn) <= angle


@njit(cache=True, nogil=True)
def is_free(near: Any, pose: Any) -> Any:
    """Whether the robot's centre can be there, to a cell."""
    column, row = int((pose[0] - near.x_m) / near.cell_m), int((pose[1] - near.y_m) / near.cell_m)
    rows, columns = near.free.shape
    return 0 <= column < columns and 0 <= row < rows and near.free[row, column]


@njit(cache=True, nogil=True)
def _normal_equations(ground: Any, beams: Any, pose: Any, scale: Any) -> Any:
    """(H, g, arm, far): sums of w J^T J and w J^T e over returns and the surfaces nearest to them.

    arm: root mean square range [m]. far: returns farther than three tolerances from any surface.
    """
    near, segments = ground.near, ground.sight.segments
    H, g, J = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    rows, columns = near.nearest.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    squares, count, far = 0.0, 0, 0
    for k in range(beams.ranges.shape[0]):
        r = beams.ranges[k]
        if np.isinf(r):
            continue
        squares += r * r
        count += 1
        dx = r * (c * beams.cosines[k] - s * beams.sines[k])
        dy = r * (s * beams.cosines[k] + c * beams.sines[k])
        x, y = pose[0] + dx, pose[1] + dy
        column, row = int((x - near.x_m) / near.cell_m), int((y - near.y_m) / near.cell_m)
        inside = 0 <= column < columns and 0 <= row < rows
        segment = near.nearest[row, column] if inside else -1
        if segment < 0:
            far += 1
            continue
        ax, ay = x - segments[segment, 0], y - segments[segment, 1]
        bx, by = segments[segment, 2] - segments[segment, 0], segments[segment, 3] - segments[segment, 1]
        square = max(bx * bx + by * by, 1e-18)
        u = (ax * bx + ay * by) / square
        if 0.0 <= u <= 1.0:
            length = math.sqrt(square)
            nx, ny = -by / length, bx / length
            error = ax * nx + ay * ny
        else:
            u = min(max(u, 0.0), 1.0)
            nx, ny = ax - u * bx, ay - u * by
            error = max(math.hypot(nx, ny), 1e-12)
            nx, ny = nx / error, ny / error
        far += abs(error) > 3 * ground.criterion.tolerance_m
        away = error / scale
        weight = 1.0 / (1.0 + away * away) ** 2
        J[0], J[1], J[2] = nx, ny, ny * dx - nx * dy
        for a in range(3):
            g[a] += weight * J[a] * error
            for b in range(3):
                H[a, b] += weight * J[a] * J[b]
    return H, g, (math.sqrt(squares / count) if count else 1.0), far


@njit(cache=True, nogil=True)
def _solve(H: Any, g: Any) -> Any:
    """x of H x = g for a positive definite (3, 3) H, by Cholesky."""
    l00 = math.sqrt(H[0, 0])
    l10, l20 = H[1, 0] / l00, H[2, 0] / l00
    l11 = math.sqrt(max(H[1, 1] - l10 * l10, 1e-30))
    l21 = (H[2, 1] - l20 * l10) / l11
    l22 = math.sqrt(max(H[2, 2] - l20 * l20 - l21 * l21, 1e-30))
    a = g[0] / l00
    b = (g[1] - l10 * a) / l11
    z = (g[2] - l20 * a - l21 * b) / (l22 * l22)
    y = (b - l21 * z) / l11
    return np.array([(a - l10 * y - l20 * z) / l00, y, z])


@njit(cache=True, nogil=True)
def _weakest(H: Any, arm: Any, guess: Any) -> Any:
    """Eigenvector (x, y, yaw * arm) of the smallest eigenvalue, by inverse iteration from a guess, pointing along it."""
    scaled = H.copy()
    for a in range(3):
        scaled[2, a] /= arm
        scaled[a, 2] /= arm
    ridge = 1e-6 * (scaled[0, 0] + scaled[1, 1] + scaled[2, 2]) + 1e-9
    for a in range(3):
        scaled[a, a] += ridge
    v = guess.copy()
    for _ in range(12):
        v = _solve(scaled, v)
        v /= math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    return v if v[0] * guess[0] + v[1] * guess[1] + v[2] * guess[2] >= 0 else -v
