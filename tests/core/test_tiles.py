"""A table of tiles answers as the polygons themselves do, for every point."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.core.polygon import crossing_number, packed
from wallkit.core.tiles import tiles_of

SHAPE = (120, 160)


def ring(rng, centre, radius, corners):
    angles = np.sort(rng.uniform(0, 2 * np.pi, corners))
    lengths = radius * rng.uniform(0.5, 1.0, corners)
    return centre + lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])


def drawn(rng):
    """Overlapping polygons with a hole in every second, rectangles on whole pixels, and one larger than the image."""
    found = []
    for k in range(6):
        centre = rng.uniform((0, 0), (160, 120))
        rings = [ring(rng, centre, rng.uniform(10, 50), int(rng.integers(3, 30)))]
        found.append([*rings, ring(rng, centre, 4.0, 8)] if k % 2 else rings)
    left, top = (int(n) for n in rng.integers(0, 80, 2))
    found.append([[(left, top), (left + 40, top), (left + 40, top + 30), (left, top + 30)]])
    found.append([[(-50, -50), (500, -40), (480, 300), (-60, 310)]])
    return found[:: int(rng.choice([1, -1]))]


@pytest.mark.parametrize("seed", range(20))
def test_tiles_answer_as_polygons_do(seed):
    rng = np.random.default_rng(seed)
    held = packed(drawn(rng)[: int(rng.integers(0, 9))])
    at = rng.uniform((-10, -10), (170, 130), (20_000, 2))
    if held.edges.shape[1]:
        # beside edges, where a tile that is wrongly taken for clear would show
        e = rng.integers(0, held.edges.shape[1], 4000)
        share = rng.uniform(0, 1, (4000, 1))
        on_edges = held.edges[:2, e].T * share + held.edges[2:4, e].T * (1 - share)
        at = np.concatenate([at, on_edges + rng.normal(0, 1e-3, (4000, 2)), np.round(on_edges)])
    at = np.concatenate([at, [[np.nan, 3.0], [3.0, np.inf], [-0.5, -0.5], [159.5, 119.5]]])
    tiles = tiles_of(held, SHAPE)
    labels, sure = rng.permutation(len(held) + 1), rng.uniform(0, 1, len(held) + 1).astype(np.float32)
    found, confidences = tiles.named(at, labels, sure)
    inside = ((at >= -0.5) & (at < (159.5, 119.5))).all(axis=1)
    expected = crossing_number(at, held)
    np.testing.assert_array_equal(found, np.where(inside, labels[expected], -1))
    np.testing.assert_array_equal(confidences, np.where(inside, sure[expected], 0))
    clear = tiles.touching == 0
    assert clear.mean() > 0.3
    np.testing.assert_array_equal(tiles.regions >= 0, clear)


def test_more_polygons_than_a_tile_can_tell_apart_have_no_table():
    square = [[(0, 0), (5, 0), (5, 5)]]
    assert tiles_of(packed([square] * 64), SHAPE) is not None
    assert tiles_of(packed([square] * 65), SHAPE) is None
    nothing = tiles_of(packed([]), SHAPE)
    assert nothing.named(np.zeros((2, 2)), np.array([7]), np.ones(1, np.float32))[0].tolist() == [7, 7]
