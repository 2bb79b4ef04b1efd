"""Bands of cells -> polylines along their middle: thinning, pixel graph, chains, simplification."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from wallkit.core.types import BoolArray, Float64Array

Pixel = tuple[int, int]
Graph = dict[Pixel, list[Pixel]]

# side branches of so few pixels are what thinning makes of a ragged edge
SPUR_PIXELS = 2
# the middle of a band is looked for no further than this
DEEPEST_CELLS = 10
# free ends are followed in steps of so many cells
STEP_CELLS = 0.1


def middle_lines(band: BoolArray, tolerance_cells: float) -> list[Float64Array]:
    """Polylines along the middle of every band of cells, split where bands branch.

    Zhang & Suen (1984) thin the band to one pixel; its pixels move to the middle of the band around them (an even width has
    no middle pixel), and Douglas & Peucker's (1973) simplification keeps what is needed to stay within the tolerance.

    Args:
        band: (H, W). tolerance_cells: how far the polylines may be from the pixels' path.

    Returns:
        (K, 2) arrays of x, y in cells; cell (row r, column c) has its centre at (c + 0.5, r + 0.5). One pixel alone gives
        a polyline of one point; loops end where they began.
    """
    import cv2

    # a border, because thinning leaves the image's edge alone
    padded = np.pad(band, 1).astype(np.uint8)
    thin = cv2.ximgproc.thinning(padded * 255)[1:-1, 1:-1] > 0
    pixels = {(int(row), int(column)) for row, column in zip(*np.nonzero(thin), strict=True)}
    graph = _without_spurs(pixels)
    middles = _middles(band)
    lines = []
    for chain in _chains(graph):
        path = np.array([(column + 0.5, row + 0.5) for row, column in chain])
        # crossings stay where they are, so that what meets there keeps meeting
        for index, pixel in enumerate(chain):
            if len(graph[pixel]) <= 2:
                path[index] = middles[pixel]
        is_loop = len(chain) > 2 and chain[0] == chain[-1]
        line = _simplified(path, tolerance_cells, is_loop=is_loop)
        for end, before, pixel in ((0, 1, chain[0]), (-1, -2, chain[-1])):
            # two pixels can have one middle, and then there is no direction to go on in
            if len(graph[pixel]) == 1 and len(line) > 1 and (line[end] != line[before]).any():
                line[end] = _last_inside(band, line[end], line[end] - line[before])
        lines.append(line)
    return lines


def _last_inside(band: BoolArray, point: Float64Array, direction: Float64Array) -> Float64Array:
    """The last point in a direction that is still on the band: thinning takes half a band's width off its ends."""
    step = direction / float(np.hypot(*direction)) * STEP_CELLS
    onward = point + step
    while 0 <= onward[0] < band.shape[1] and 0 <= onward[1] < band.shape[0] and band[int(onward[1]), int(onward[0])]:
        point, onward = onward, onward + step
    return point


def _middles(band: BoolArray) -> Float64Array:
    """(H, W, 2) mean x, y [cells] of the band's cells around each cell of it, as far around as the band is deep there."""
    import cv2

    depth = cv2.distanceTransform(np.pad(band, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    depth = np.minimum(np.floor(depth), DEEPEST_CELLS).astype(int)
    weight = band.astype(np.float64)
    rows, columns = np.indices(band.shape)
    middles = np.stack([columns + 0.5, rows + 0.5], axis=-1)
    for reach in range(1, int(depth.max(initial=0)) + 1):
        # outside of the image there is no band, whatever the edge's cell is
        count, x, y = (
            cv2.boxFilter(values, -1, (2 * reach + 1,) * 2, normalize=False, borderType=cv2.BORDER_CONSTANT)
            for values in (weight, weight * (columns + 0.5), weight * (rows + 0.5))
        )
        here = depth == reach
        middles[here] = np.stack([x[here], y[here]], axis=-1) / count[here, None]
    return middles


def _simplified(path: Float64Array, tolerance_cells: float, *, is_loop: bool) -> Float64Array:
    import cv2

    if len(path) < 3:
        return path
    curve = (path[:-1] if is_loop else path).astype(np.float32)[:, None]
    kept = cv2.approxPolyDP(curve, tolerance_cells, is_loop)[:, 0].astype(np.float64)
    return np.vstack([kept, kept[:1]]) if is_loop and len(kept) > 1 else kept


def _linked(pixels: set[Pixel]) -> Graph:
    """Neighbours of each pixel; diagonal ones only where no straight step leads there, so that a corner is no crossing."""
    graph: Graph = {}
    for row, column in sorted(pixels):
        straight = [(row, column - 1), (row, column + 1), (row - 1, column), (row + 1, column)]
        near = [pixel for pixel in straight if pixel in pixels]
        for up in (-1, 1):
            for right in (-1, 1):
                diagonal = (row + up, column + right)
                if diagonal in pixels and (row + up, column) not in pixels and (row, column + right) not in pixels:
                    near.append(diagonal)
        graph[row, column] = near
    return graph


def _without_spurs(pixels: set[Pixel]) -> Graph:
    """The graph of the pixels, short dead ends that branch off something longer left out."""
    graph = _linked(pixels)
    spurs: set[Pixel] = set()
    for pixel, near in graph.items():
        if len(near) != 1:
            continue
        spur = [pixel]
        while len(spur) <= SPUR_PIXELS:
            onward = [n for n in graph[spur[-1]] if n not in spur]
            if len(onward) != 1:
                break
            if len(graph[onward[0]]) > 2:
                spurs.update(spur)
                break
            spur.append(onward[0])
    return _linked(pixels - spurs)


def _chains(graph: Graph) -> Iterator[list[Pixel]]:
    """Every link of the graph once, as the longest runs of pixels between ends and crossings; loops begin and end alike."""
    walked: set[tuple[Pixel, Pixel]] = set()
    for pixel, near in graph.items():
        if not near:
            yield [pixel]
    # first from ends and crossings; what is left then are loops
    for from_loops in (False, True):
        for pixel, near in graph.items():
            if (len(near) == 2) != from_loops:
                continue
            for following in near:
                if (pixel, following) in walked:
                    continue
                chain = [pixel, following]
                while len(graph[chain[-1]]) == 2 and chain[-1] != pixel:
                    first, second = graph[chain[-1]]
                    chain.append(second if first == chain[-2] else first)
                walked.update(pairwise(chain))
                walked.update(pairwise(chain[::-1]))
                yield chain
