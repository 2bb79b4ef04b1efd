"""What a lens lets through -> the picture a real camera makes of it: exposure, colour, blur, noise, and JPEG."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wallkit.core.config import setting
from wallkit.core.types import Float64Array, UInt8Array

# of linear light in the 8 bits a renderer gives
_DECODE = (np.arange(256) / 255.0) ** 2.2
_BRIGHT = 0.46


@dataclass(frozen=True)
class Photo:
    """A camera's electronics and optics; with the first five at zero or one it shows exactly what the renderer gives."""

    auto_exposure: float = setting(0.7, "how far it goes to a middle brightness by itself", low=0, high=1)
    exposure: float = setting(1.0, "times the light", low=0.05, high=20)
    vignette: float = setting(0.15, "share of light lost in the corners", low=0, high=1)
    read_noise: float = setting(0.004, "noise in the dark, of full scale", low=0, high=0.5)
    shot_noise: float = setting(0.010, "noise at full scale, growing with the root of the light", low=0, high=0.5)
    warmth: float = setting(0.0, "white balance: above 0 reddish, below bluish", low=-1, high=1)
    gamma: float = setting(1.0, "above 1 darker middle tones", low=0.2, high=5)
    defocus_px: float = setting(0.0, "sigma of a lens out of focus", low=0, high=20)
    exposure_s: float = setting(0.0, "the shutter stays open so long, and what moves is blurred", low=0, high=1)
    exposures: int = setting(4, "pictures that are averaged while the shutter is open", low=2, high=64)
    exposure_lag_s: float = setting(0.0, "auto exposure goes by the light of so long ago", low=0, high=10)
    readout_s: float = setting(
        0.0, "rolling shutter: from reading the first row to the last; the stamp is the middle one's", low=0, high=1
    )
    strips: int = setting(8, "rows are read in so many strips, each a picture of its own moment", low=2, high=64)
    variety: float = setting(0.0, "how far all of this differs by chance between pictures", low=0, high=1)
    jpeg_quality: int = setting(90, "of the recorded JPEG", low=1, high=100)


PERFECT = Photo(auto_exposure=0.0, vignette=0.0, read_noise=0.0, shot_noise=0.0, jpeg_quality=95)
# what is no matter of one picture in its own light
_OF_TIME: dict[str, Any] = {
    name: getattr(PERFECT, name)
    for name in ("exposure_s", "exposures", "exposure_lag_s", "readout_s", "strips", "jpeg_quality")
}


def developed(
    rng: np.random.Generator, photo: Photo, image: UInt8Array, *, metered: UInt8Array | None = None
) -> UInt8Array:
    """(H, W, 3) as the camera gives it, of (H, W, 3) as it was rendered.

    Args:
        metered: (H, W, 3) as it was rendered, that auto exposure goes by; None: the image itself.
    """
    import cv2

    photo = _varied(rng, photo)
    if replace(photo, **_OF_TIME) == PERFECT:
        return image
    light: Any = _DECODE.astype(np.float32)[image]
    light = light * np.float32(_gain(photo, light if metered is None else _DECODE[metered])) * _balance(photo.warmth)
    if photo.vignette > 0:
        light *= _vignette(photo.vignette, image.shape[:2])[..., None]
    if photo.defocus_px > 0:
        light = cv2.GaussianBlur(light, (0, 0), photo.defocus_px)
    if photo.read_noise > 0 or photo.shot_noise > 0:
        sigma = np.sqrt(photo.read_noise**2 + photo.shot_noise**2 * np.maximum(light, 0))
        light += sigma * rng.standard_normal(light.shape, dtype=np.float32)
    encoded = np.clip(light, 0, 1) ** np.float32(photo.gamma / 2.2)
    return np.asarray(encoded * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def jpeg_from_pixels(pixels: UInt8Array, quality: int) -> bytes:
    """RGB pixels (H, W, 3) as JPEG."""
    import cv2

    _, data = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data)


def _varied(rng: np.random.Generator, photo: Photo) -> Photo:
    if photo.variety == 0:
        return photo
    v = photo.variety
    draws = rng.standard_normal(3)
    return replace(
        photo,
        exposure=photo.exposure * float(np.exp(0.5 * v * draws[0])),
        warmth=float(np.clip(photo.warmth + 0.5 * v * draws[1], -1, 1)),
        gamma=photo.gamma * float(np.exp(0.15 * v * draws[2])),
        defocus_px=photo.defocus_px + float(rng.exponential(0.6 * v)),
        variety=0.0,
    )


def _gain(photo: Photo, light: np.ndarray) -> float:
    """What the light is multiplied by: of auto exposure, part of the way to a middle brightness."""
    middle = float(np.mean(light[::8, ::8])) + 1e-3
    wanted = np.clip(_BRIGHT**2.2 / middle, 0.2, 6.0)
    return float(photo.exposure * wanted**photo.auto_exposure)


def _balance(warmth: float) -> np.ndarray:
    return np.array([1 + 0.25 * warmth, 1.0, 1 - 0.25 * warmth], dtype=np.float32)


def _vignette(strength: float, shape: tuple[int, int]) -> Float64Array:
    """(H, W) 1 in the middle, 1 - strength in the corners, falling as the square of the distance."""
    v, u = (np.linspace(-1, 1, n, dtype=np.float32) for n in shape)
    return 1 - np.float32(strength) * (u[None] ** 2 + v[:, None] ** 2) / 2
