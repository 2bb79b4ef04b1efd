"""Planar scans and their pictures -> by how many pixels the room's vertical edges and its floor line are missed.

A scan sees an edge of the room where its range jumps and a corner where two walls meet; raised along the LiDAR's axis such a
point is a vertical line in the picture, and dropped to the floor every wall point lies on the line between wall and floor.
The first sees yaw (and a shift to the side), the second pitch (and the height). Neither sees anything else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.calib.verify.gates import Gate
from wallkit.core.camera import Camera
from wallkit.core.types import BoolArray, Float64Array, Int64Array, UInt8Array

REACH_PX = 30
FEWEST = 12
# share of the image's width in px: PASS and FAIL of the median, as 5 and 10 px of 1280
GOOD_SHARE, BAD_SHARE = 5 / 1280, 10 / 1280
_JUMP_M, _CORNER_DEG = 0.25, 40.0
_RISE_M = np.linspace(-0.25, 1.0, 40)
# a peak must stand out so far over the strip around it
_STANDS_OUT = 3.0


@dataclass(frozen=True, eq=False)
class LineOffsets:
    """How far lines of the picture are from where the scan puts them: (N,) px, and how many lines were looked for."""

    offsets_px: Float64Array
    looked_for: int


def vertical_offsets(camera: Camera, T: Float64Array, grey: UInt8Array, points_m: Float64Array) -> LineOffsets:
    """Horizontal px from each edge and corner of a scan (N, 3; in the order of bearing) to the vertical line near it."""
    strength = _gradient(grey, horizontal=True)
    feet = points_m[edges_of_scan(points_m)]
    lines = feet[:, None, :] + _RISE_M[None, :, None] * np.array([0.0, 0.0, 1.0])
    return _offsets(camera, T, strength, lines, np.array([1, 0]))


def floor_offsets(
    camera: Camera, T: Float64Array, grey: UInt8Array, points_m: Float64Array, *, height_m: float
) -> LineOffsets:
    """Vertical px from each stretch of wall, dropped by the LiDAR's height, to the line between wall and floor."""
    strength = _gradient(grey, horizontal=False)
    stretches = [points_m[i : i + 12] for i in range(0, len(points_m) - 12, 6)]
    straight = [s for s in stretches if np.linalg.norm(np.diff(s, axis=0), axis=1).max() < _JUMP_M / 2]
    lines = np.array(straight).reshape(-1, 12, 3) - np.array([0.0, 0.0, height_m])
    return _offsets(camera, T, strength, lines, np.array([0, 1]))


def edges_of_scan(points_m: Float64Array) -> Int64Array:
    """Indices of the nearer sides of jumps in range, and of corners between straight walls."""
    ranges = np.linalg.norm(points_m, axis=1)
    jumps = np.flatnonzero(np.abs(np.diff(ranges)) > np.maximum(_JUMP_M, 0.1 * ranges[:-1]))
    nearer = [int(i if ranges[i] < ranges[i + 1] else i + 1) for i in jumps]
    return np.array(sorted({*nearer, *_corners(points_m, jumps)}), dtype=np.int64)


def lines_gate(name: str, found: Sequence[LineOffsets], camera: Camera, *, sees: str) -> Gate:
    """The median over all frames: PASS for the axes that it sees, FAIL where it is far off and sure, else CANNOT TELL."""
    offsets = np.concatenate([f.offsets_px for f in found]) if found else np.zeros(0)
    label, good, bad = f"{name}, seen: {sees}", GOOD_SHARE * camera.width, BAD_SHARE * camera.width
    wanted, refused, basis = f"<= {good:.3g}", f"> {bad:.3g} and 4 sigma", f"sees {sees} only"
    looked_for = sum(f.looked_for for f in found)
    if len(offsets) < FEWEST:
        reason = f"{len(offsets)} of {looked_for} lines stand out in the pictures; {FEWEST} are the least"
        return Gate(label, np.nan, "px", wanted, "CANNOT TELL", reason, refused, basis)
    middle = float(np.median(offsets))
    sigma = 1.2533 * 1.4826 * float(np.median(np.abs(offsets - middle))) / np.sqrt(len(offsets))
    reason = (
        f"lines of the room are {middle:+.1f} +- {sigma:.1f} px from where the scan puts them ({len(offsets)} lines)"
    )
    if abs(middle) > bad and abs(middle) > 4 * sigma:
        return Gate(label, abs(middle), "px", wanted, "FAIL", reason, refused, basis)
    if abs(middle) > good or 2 * sigma > good:
        return Gate(label, abs(middle), "px", wanted, "CANNOT TELL", reason, refused, basis)
    return Gate(label, abs(middle), "px", wanted, "PASS", "", refused, basis)


def _corners(points: Float64Array, jumps: Int64Array, reach: int = 6) -> list[int]:
    """Where two straight stretches of `reach` returns meet at an angle, the sharpest of its neighbourhood."""
    if len(points) < 2 * reach + 1:
        return []
    middle = np.arange(reach, len(points) - reach)
    before, after = points[middle] - points[middle - reach], points[middle + reach] - points[middle]
    lengths = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    angles = np.degrees(np.arccos(np.clip((before * after).sum(axis=1) / np.maximum(lengths, 1e-9), -1, 1)))
    crossed = np.zeros(len(points) + 1)
    crossed[1 + jumps] = 1
    total = np.cumsum(crossed)
    whole = total[middle + reach] == total[middle - reach]
    found: list[int] = []
    for k in np.flatnonzero((angles > _CORNER_DEG) & whole):
        near = slice(max(0, k - reach), k + reach + 1)
        if angles[k] >= angles[near].max() - 1e-12 and (not found or middle[k] - found[-1] > reach):
            found.append(int(middle[k]))
    return found


def _gradient(grey: UInt8Array, *, horizontal: bool) -> Float64Array:
    """(H, W) strength of edges across one direction, where they do not run along it."""
    import cv2

    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    gx, gy = cv2.Sobel(smooth, cv2.CV_64F, 1, 0), cv2.Sobel(smooth, cv2.CV_64F, 0, 1)
    own, other = (np.abs(gx), np.abs(gy)) if horizontal else (np.abs(gy), np.abs(gx))
    return np.asarray(np.where(own > 2 * other, np.minimum(own, 120.0), 0.0))


def _offsets(
    camera: Camera, T: Float64Array, strength: Float64Array, lines: Float64Array, along: Int64Array
) -> LineOffsets:
    """For each line (L, M, 3) the shift along (du, dv) with most edge strength under it, where a peak stands out."""
    shifts = np.arange(-REACH_PX, REACH_PX + 1)
    found: list[float] = []
    looked_for = 0
    for line in lines:
        pixels = camera.project(line @ T[:3, :3].T + T[:3, 3])
        inside: BoolArray = camera.is_inside(pixels)
        if inside.sum() < max(6, len(line) // 3):
            continue
        looked_for += 1
        at = np.round(pixels[inside]).astype(np.int64)[None] + shifts[:, None, None] * along
        u, v = at[..., 0].clip(0, camera.width - 1), at[..., 1].clip(0, camera.height - 1)
        score = strength[v, u].mean(axis=1)
        best = int(score.argmax())
        spread = max(1.4826 * float(np.median(np.abs(score - np.median(score)))), 2.0)
        if score[best] - np.median(score) > _STANDS_OUT * spread and 0 < best < len(shifts) - 1:
            found.append(float(shifts[best]))
    return LineOffsets(np.array(found), looked_for)
