"""Errors put in on purpose, to study what breaks the camera's filters: of the calibration, of the clock, and lost images.

The filters do not know of them: margins and verdicts stay those of the calibration as it was.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace

import numpy as np

from wallkit.core.calibration import Calibration
from wallkit.core.config import setting
from wallkit.core.types import Float64Array, Frame


@dataclass(frozen=True)
class PerturbSettings:
    """Errors put in on purpose; with all of them 0 nothing is changed. Axes are those of the camera: right, down, ahead."""

    rotation_deg: float = setting(0.0, "the camera is taken to look this much elsewhere, turned about its own centre")
    rotation_axis: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "about this axis: 0 1 0 is to the side, 1 0 0 up and down; 0 0 0: one drawn by perturb.seed"
    )
    translation_cm: float = setting(0.0, "the camera is taken to be this far from where it is")
    translation_axis: tuple[float, float, float] = setting(
        (0.0, 0.0, 0.0), "along this axis; 0 0 0: one drawn by perturb.seed"
    )
    time_offset_ms: float = setting(0.0, "images are taken to be this much older than they are")
    mask_px: float = setting(
        0.0, "masks of perturb.mask_classes grow by so many pixels of the image, or shrink if below 0"
    )
    mask_classes: tuple[str, ...] = setting(("wall", "partition"), "whose masks those are")
    drop_share: float = setting(0.0, "this share of the images is lost, drawn by perturb.seed", low=0, high=1)
    seed: int = setting(0, "of what is drawn", low=0)

    @property
    def said(self) -> tuple[str, ...]:
        """The errors that are put in, as they are set."""
        errors = ("rotation_deg", "translation_cm", "time_offset_ms", "mask_px", "drop_share")
        return tuple(f"{f.name} = {getattr(self, f.name):g}" for f in fields(self)
                     if f.name in errors and getattr(self, f.name))  # fmt: skip


def perturbed(calibration: Calibration, settings: PerturbSettings) -> Calibration:
    """The calibration, wrong by what is set: T <- [Exp(w) dt; 0 1] T, so that a turn leaves the camera's centre in place."""
    T, s = calibration.T_camera_lidar, settings
    if T is not None and (s.rotation_deg or s.translation_cm):
        rng = np.random.default_rng(s.seed)
        turned, moved = _axis(s.rotation_axis, rng), _axis(s.translation_axis, rng)
        error = np.eye(4)
        error[:3, :3] = _rotation(np.deg2rad(s.rotation_deg) * turned)
        error[:3, 3] = s.translation_cm / 100 * moved
        T = error @ T
        # products of rotations drift from being one
        u, _, vt = np.linalg.svd(T[:3, :3])
        T[:3, :3] = u @ vt
    offset_ns = calibration.time_offset_ns + round(s.time_offset_ms * 1e6)
    return replace(calibration, T_camera_lidar=T, time_offset_ns=offset_ns)


def without_dropped(frame: Frame, settings: PerturbSettings) -> Frame:
    """The frame without the images that are lost; an image that is lost at one share is lost at every larger one."""
    if not settings.drop_share or not frame.views:
        return frame
    views = tuple(v for v in frame.views if _drawn(settings.seed, v.topic, v.image.stamp_ns) >= settings.drop_share)
    return replace(frame, views=views)


def _drawn(seed: int, topic: str, stamp_ns: int) -> float:
    """In [0, 1), the same for an image in every run."""
    digest = hashlib.blake2b(f"{seed} {topic} {stamp_ns}".encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") / 2**64


def _axis(given: tuple[float, float, float], rng: np.random.Generator) -> Float64Array:
    """(3,) of length 1; drawn evenly over the sphere where none is given."""
    drawn = rng.normal(size=3)
    axis = np.array(given, dtype=np.float64) if any(given) else drawn
    return np.asarray(axis / np.linalg.norm(axis))


def _rotation(w: Float64Array) -> Float64Array:
    """(3, 3) Exp(w), Rodrigues."""
    angle = float(np.linalg.norm(w))
    if angle == 0:
        return np.eye(3)
    x, y, z = w / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
