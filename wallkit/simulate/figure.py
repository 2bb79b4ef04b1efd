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
_JOINTS = ("hip", "knee", "ankle", "heel", "toe", "shoulder", "elbow", "wrist")
_HIP_AT, _KNEE_AT, _ANKLE_AT, _HEEL_AT, _TOE_AT, _SHOULDER_AT, _ELBOW_AT, _WRIST_AT = range(len(_JOINTS))
_IS_ARM = (False,) * 5 + (True,) * 3
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
    sides = np.array([1.0, -1.0])
    # swept evenly, by as much as the body moves on meanwhile: the foot on the floor stays there
    both = phase[:, None] + np.array([0.0, math.pi])
    swing = vigour[:, None] * _SWING * np.arcsin(0.98 * np.sin(both))
    # the knee bends while its leg comes forward
    bend = 0.75 * vigour[:, None] * np.maximum(0.0, np.cos(both))
    points = np.zeros((len(people), 2, len(_JOINTS), 3))
    x, y, z = np.moveaxis(points, -1, 0)
    tall = h[:, None]
    y[:] = (girth[:, None] * sides)[..., None] * np.where(np.array(_IS_ARM), 0.19, 0.09)
    z[..., _HIP_AT] = _HIP * tall
    z[..., _SHOULDER_AT] = _SHOULDER * tall
    for before, after, angle, share in (
        (_HIP_AT, _KNEE_AT, swing, _THIGH),
        (_KNEE_AT, _ANKLE_AT, swing - bend, _SHIN),
        (_SHOULDER_AT, _ELBOW_AT, -0.8 * swing, _ARM),
        (_ELBOW_AT, _WRIST_AT, -0.8 * swing + 0.35, _ARM),
    ):
        x[..., after] = x[..., before] + np.sin(angle) * share * tall
        z[..., after] = z[..., before] - np.cos(angle) * share * tall
    x[..., _HEEL_AT], z[..., _HEEL_AT] = x[..., _ANKLE_AT] - 0.04, z[..., _ANKLE_AT] - 0.02
    x[..., _TOE_AT] = x[..., _ANKLE_AT] + 0.11 * tall * np.cos(bend / 2)
    z[..., _TOE_AT] = z[..., _ANKLE_AT] - 0.055 * tall * np.sin(bend / 2) - 0.02
    starts = points[:, :, (_HIP_AT, _KNEE_AT, _HEEL_AT, _SHOULDER_AT, _ELBOW_AT)].reshape(len(people), 10, 3)
    ends = points[:, :, (_KNEE_AT, _ANKLE_AT, _TOE_AT, _ELBOW_AT, _WRIST_AT)].reshape(len(people), 10, 3)
    trunk = np.zeros((2, len(people), 3, 3))
    # hips from side to side, torso and head upwards
    trunk[:, :, 0, 1] = [[0.1], [-0.1]]
    trunk[:, :, 1:, 0] = [[[0.0, 0.02]], [[0.02, 0.03]]]
    trunk[0, :, :, 2] = np.column_stack([_HIP * h, (_HIP + 0.06) * h, 0.90 * h])
    trunk[1, :, :, 2] = np.column_stack([_HIP * h, _SHOULDER * h - 0.05, 0.96 * h])
    T_person_part = _between(np.concatenate([starts, trunk[0]], axis=1), np.concatenate([ends, trunk[1]], axis=1))
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    T_map_person = np.tile(np.eye(4), (len(people), 1, 1, 1))
    T_map_person[:, 0, 0, 0], T_map_person[:, 0, 0, 1] = c, -s
    T_map_person[:, 0, 1, 0], T_map_person[:, 0, 1, 1] = s, c
    T_map_person[:, 0, :2, 3] = poses[:, :2]
    return np.asarray(T_map_person @ T_person_part)


# -------------------------------------------------------------------------------------------- details


def _between(a: Float64Array, b: Float64Array) -> Float64Array:
    """(..., 4, 4) of capsules, axis z, from joints (..., 3) to the next."""
    z = b - a
    z /= np.sqrt(np.sum(z * z, axis=-1, keepdims=True))
    # x = y0 cross z, or (of a capsule along y) the x axis itself, which is square to it
    lies = np.abs(z[..., 1]) > 0.9
    x = np.stack([z[..., 2], np.zeros_like(z[..., 0]), -z[..., 0]], axis=-1)
    x[lies] = (1.0, 0.0, 0.0)
    x /= np.sqrt(np.sum(x * x, axis=-1, keepdims=True))
    T = np.zeros((*a.shape[:-1], 4, 4))
    T[..., :3, 0], T[..., :3, 2] = x, z
    T[..., 0, 1] = z[..., 1] * x[..., 2] - z[..., 2] * x[..., 1]
    T[..., 1, 1] = z[..., 2] * x[..., 0] - z[..., 0] * x[..., 2]
    T[..., 2, 1] = z[..., 0] * x[..., 1] - z[..., 1] * x[..., 0]
    T[..., :3, 3] = (a + b) / 2
    T[..., 3, 3] = 1.0
    return T
