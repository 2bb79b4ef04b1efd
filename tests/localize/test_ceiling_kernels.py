"""The loops against their formulas in NumPy, pixel by pixel: float32 sums in another order differ by less than 2e-6."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.localize.ceiling_kernels import UNKNOWN, exposed_costs, gradient_costs

RNG = np.random.default_rng(5)
SIDE, PARTICLES = 7, 300
MOST, UNSEEN = np.float32(0.3), np.float32(0.17)
STEPS = (np.arange(SIDE) - 3) * np.float32(6.3)
POINTS = np.stack(np.meshgrid(STEPS, STEPS, indexing="ij")).astype(np.float32)
YAW = RNG.uniform(-3, 3, PARTICLES)
# some of them see beyond the picture of 90 x 70 pixels
PLACED = np.stack([np.cos(YAW), np.sin(YAW), RNG.uniform(-20, 110, PARTICLES), RNG.uniform(-20, 90, PARTICLES)]).astype(
    np.float32
)


def framed(values, empty):
    """With holes, and a border that nobody has seen."""
    hollow = np.where(RNG.random(values.shape[:2]).reshape(values.shape[:2] + (1,) * (values.ndim - 2)) < 0.2, 0, 1)
    values = np.where(hollow, values, empty)
    return np.pad(values, ((1, 1), (1, 1)) + ((0, 0),) * (values.ndim - 2), constant_values=empty)


def looked_up(image):
    """(N, K) pixels that the points of each pose fall on."""
    c, s, x, y = PLACED[:, :, None]
    px, py = POINTS.reshape(2, -1)
    column = np.clip(x + c * px - s * py, 0, image.shape[1] - 1).astype(int)
    row = np.clip(y + s * px + c * py, 0, image.shape[0] - 1).astype(int)
    return image[row, column]


def most_agree(got, expected):
    """All but the poses one of whose points lies on the edge of two pixels, where float32 may choose the other."""
    assert (np.abs(got - expected) < 2e-6).mean() > 0.98
    assert np.abs(got - expected).max() < 0.05


@pytest.mark.parametrize("limit", [1.0, 2.0])
@pytest.mark.parametrize("order", [1.0, 2.0, 2.5, 4.0])
def test_exposed_costs_are_those_of_the_exposure_that_fits_best(order, limit):
    planes = np.concatenate([RNG.integers(20, 250, (70, 90, 3)), np.ones((70, 90, 1), int)], axis=2)
    image = np.ascontiguousarray(framed(planes, 0).astype(np.uint8)).view("<u4")[..., 0]
    z = RNG.uniform(0.1, 0.9, (SIDE * SIDE, 3)).astype(np.float32)
    pixels = looked_up(image.copy().view(np.uint8).reshape(*image.shape, 4))
    m, known = pixels[..., :3] / 255, pixels[..., 3]
    luma = np.array([0.299, 0.587, 0.114])
    bright, grey = z @ luma, known * (m @ luma)
    gain, fits = np.ones((PARTICLES, 1)), known.astype(float)
    for _ in range(3 if limit > 1 else 1):
        gain = (((fits * bright).sum(1) + 1e-6) / ((fits * grey).sum(1) + 1e-6)).clip(1 / limit, limit)[:, None]
        fits = known * (np.abs(bright - gain * grey) < MOST)
    norm = (np.abs(z / gain[..., None] - m) ** order).sum(axis=2) ** (1 / order)
    expected = np.where(known, np.minimum(norm, MOST), UNSEEN).mean(axis=1)
    got = np.zeros(PARTICLES)
    colours, points = np.ascontiguousarray(z.T), np.ascontiguousarray(POINTS.reshape(2, -1))
    exposed_costs(PLACED, points, colours, np.float32(order), np.float32(limit), MOST, UNSEEN, image.copy(), got)
    most_agree(got, expected)


def test_gradient_costs_are_those_of_all_pairs_of_neighbours():
    image = framed(RNG.normal(-1, 0.4, (70, 90)), 2 * UNKNOWN).astype(np.float32)
    z = RNG.normal(-1, 0.4, (SIDE, SIDE)).astype(np.float32)
    seen = (RNG.random((SIDE, SIDE)) < 0.8).astype(np.float32)
    m = looked_up(image).reshape(-1, SIDE, SIDE)
    rest, total, pairs = z - m, np.zeros(PARTICLES), 0.0
    for axis in (0, 1):
        both = np.take(seen, range(1, SIDE), axis) * np.take(seen, range(SIDE - 1), axis)
        later, earlier = (np.take(m, where, axis + 1) > UNKNOWN for where in (range(1, SIDE), range(SIDE - 1)))
        cost = np.where(later & earlier, np.minimum(np.abs(np.diff(rest, axis=axis + 1)), MOST), UNSEEN)
        total, pairs = total + (both * cost).sum(axis=(1, 2)), pairs + both.sum()
    got = np.zeros(PARTICLES)
    gradient_costs(PLACED, POINTS, z, seen, MOST, UNSEEN, image, got)
    most_agree(got, total / pairs)
