"""Walking people as capsules: legs that swing with the distance walked, so that feet do not slide over the floor.

At a LiDAR's height, 10 to 40 cm above the floor, one sees what a real one sees: two shins that part and pass each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.simulate.world import Body, Solid

CLASS = "person"
# length of a stride, which is two steps, as a share of the height (Winter, Biomechanics of Human Movement, 2009: 0.7 to 0.9)
_STRIDE = 0.76
# shares of the height (Winter 2009, figure 4.1): hip and shoulder above the floor, thigh, shin, half of an arm
_HIP, _SHOULDER, _THIGH, _SHIN, _ARM = 0.53, 0.818, 0.245, 0.246, 0.17
_SWING = 2 / math.pi * _STRIDE / (4 * (_THIGH + _SHIN))
_LIMBS = ("thigh", "shin", "foot", "upper_arm", "forearm")
PARTS = (*(f"{limb}_{side}" for side in "lr" for limb in _LIMBS), "hips", "torso", "head")


@dataclass(frozen=True)
class Figure:
    """One person's size: height [m] and girth relative to the average."""

    name: str
    height_m: float = 1.72
    girth: float = 1.0

    @property
    def solids(self) -> tuple[Solid, ...]:
        """A capsule for each of PARTS, carried by a body of its own."""
        h, g = self.height_m, self.girth
        sizes = {
            "thigh": (0.075 * g, _THIGH * h - 0.12),
            "shin": (0.055 * g, _SHIN * h - 0.10),
            "foot": (0.045 * g, 0.15 * h - 0.09),
            "upper_arm": (0.045 * g, _ARM * h - 0.06),
            "forearm": (0.038 * g, _ARM * h - 0.06),
            "hips": (0.12 * g, 0.10 * g),
            "torso": (0.145 * g, 0.20 * h),
            "head": (0.095, 0.06 * h),
        }
        kinds = [part.removesuffix("_l").removesuffix("_r") for part in PARTS]
        return tuple(
            Solid(self.name, CLASS, "capsule", sizes[kind], np.eye(4), f"{self.name}.{part}", look=kind)
            for part, kind in zip(PARTS, kinds, strict=True)
        )

    @property
    def bodies(self) -> tuple[Body, ...]:
        """A free body for each of PARTS."""
        return tuple(Body(f"{self.name}.{part}") for part in PARTS)


def figures(rng: np.random.Generator, count: int) -> tuple[Figure, ...]:
    """People of different sizes, named person_0, person_1, ..."""
    heights, girths = rng.normal(1.71, 0.09, count), rng.normal(1.0, 0.08, count)
    return tuple(
        Figure(f"person_{k}", float(np.clip(h, 1.5, 1.95)), float(np.clip(g, 0.85, 1.25)))
        for k, (h, g) in enumerate(zip(heights, girths, strict=True))
    )


def postures(
    people: Sequence[Figure], poses: Float64Array, walked_m: Float64Array, speeds_m_s: Float64Array
) -> Float64Array:
    """T_map_body (P, 13, 4, 4) of the PARTS of people at (P, 3) x, y, yaw who have walked (P,) and walk or stand."""
    h = np.array([figure.height_m for figure in people])
    girth = np.array([figure.girth for figure in people])
    # whoever stands has the legs together; the stride of those who walk is the same at any pace
    vigour = np.minimum(speeds_m_s / 0.3, 1.0)
    phase = 2 * math.pi * walked_m / (_STRIDE * h)
    starts, ends = [], []
    for side, lead in ((1.0, 0.0), (-1.0, math.pi)):
        # swept evenly, by as much as the body moves on meanwhile: the foot on the floor stays there
        swing = vigour * _SWING * np.arcsin(0.98 * np.sin(phase + lead))
        # the knee bends while its leg comes forward
        bend = 0.75 * vigour * np.maximum(0.0, np.cos(phase + lead))
        hip = _point(0, side * 0.09 * girth, _HIP * h)
        knee = hip + _hanging(swing, _THIGH * h)
        ankle = knee + _hanging(swing - bend, _SHIN * h)
        heel = ankle + _point(-0.04 + 0 * h, 0, -0.02)
        toe = ankle + _point(0.11 * h * np.cos(bend / 2), 0, -0.055 * h * np.sin(bend / 2) - 0.02)
        shoulder = _point(0, side * 0.19 * girth, _SHOULDER * h)
        elbow = shoulder + _hanging(-0.8 * swing, _ARM * h)
        wrist = elbow + _hanging(-0.8 * swing + 0.35, _ARM * h)
        starts += [hip, knee, heel, shoulder, elbow]
        ends += [knee, ankle, toe, elbow, wrist]
    starts += [_point(0, 0.1, _HIP * h), _point(0, 0, (_HIP + 0.06) * h), _point(0.02, 0, 0.90 * h)]
    ends += [_point(0, -0.1, _HIP * h), _point(0.02, 0, _SHOULDER * h - 0.05), _point(0.03, 0, 0.96 * h)]
    T_person_part = _between(np.stack(starts, axis=1), np.stack(ends, axis=1))
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    T_map_person = np.tile(np.eye(4), (len(people), 1, 1, 1))
    T_map_person[:, 0, 0, 0], T_map_person[:, 0, 0, 1] = c, -s
    T_map_person[:, 0, 1, 0], T_map_person[:, 0, 1, 1] = s, c
    T_map_person[:, 0, :2, 3] = poses[:, :2]
    return np.asarray(T_map_person @ T_person_part)


# -------------------------------------------------------------------------------------------- details


def _point(x: object, y: object, z: object) -> Float64Array:
    """(P, 3)"""
    return np.stack(np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (x, y, z))), axis=-1)


def _hanging(angle_rad: Float64Array, length_m: Float64Array) -> Float64Array:
    """(P, 3) from a joint to the end of a limb that hangs forward by an angle."""
    return _point(np.sin(angle_rad) * length_m, 0.0, -np.cos(angle_rad) * length_m)


def _between(a: Float64Array, b: Float64Array) -> Float64Array:
    """(..., 4, 4) of capsules, axis z, from joints (..., 3) to the next."""
    a, b = np.broadcast_arrays(a, b)
    z = (b - a) / np.linalg.norm(b - a, axis=-1, keepdims=True)
    beside = np.where(np.abs(z[..., 1:2]) < 0.9, [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    x = np.cross(beside, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    T = np.zeros((*a.shape[:-1], 4, 4))
    T[..., :3, 0], T[..., :3, 1], T[..., :3, 2] = x, np.cross(z, x), z
    T[..., :3, 3] = (a + b) / 2
    T[..., 3, 3] = 1.0
    return T
