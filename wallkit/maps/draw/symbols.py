"""A fixture's class and its size seen from above -> the lines by which a reader of floor plans knows it.

Symbols live in the fixture's frame: u runs from its back (at the wall) into the room, v to its left, both in metres. They
never leave the footprint, but for the ticks behind a mirror.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from wallkit.core.types import Float64Array

Lines = list[Float64Array]
# (u0, v0, u1, v1) of the footprint in the fixture's frame
Box = tuple[float, float, float, float]

_WITHOUT = ("wall", "door", "window", "glass", "partition")
_TURN: Float64Array = np.linspace(0.0, 2 * np.pi, 33)
_HALF: Float64Array = np.linspace(-np.pi / 2, np.pi / 2, 17)


def symbol_of(class_name: str, link: str, box: Box) -> Lines:
    """Lines (N, 2) in the fixture's frame; none for a class that has no symbol.

    Args:
        link: its name, which tells a chair from a table, in whatever class a map has for them.
    """
    draw = SYMBOLS.get(class_name)
    if draw is not None or class_name in _WITHOUT:
        return draw(box) if draw is not None else []
    word = next((word for word in FURNITURE if word in link.lower()), "")
    return FURNITURE[word](box) if word else []


# -------------------------------------------------------------------------------------------- details


def _rect(u0: float, v0: float, u1: float, v1: float) -> Float64Array:
    return np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1), (u0, v0)])


def _oval(u: float, v: float, a: float, b: float) -> Float64Array:
    return np.column_stack([u + a * np.cos(_TURN), v + b * np.sin(_TURN)])


def _inset(box: Box, share: float) -> Box:
    u0, v0, u1, v1 = box
    by = share * min(u1 - u0, v1 - v0)
    return u0 + by, v0 + by, u1 - by, v1 - by


def _toilet(box: Box) -> Lines:
    """A cistern at the wall, a seat before it, the bowl in the seat."""
    u0, v0, u1, v1 = box
    deep, wide, v = u1 - u0, v1 - v0, (v0 + v1) / 2
    back = u0 + 0.24 * deep
    centre, a, b = (back + u1) / 2 + 0.01 * deep, (u1 - back) / 2 - 0.01 * deep, 0.46 * wide
    return [
        _rect(u0 + 0.02 * deep, v0 + 0.03 * wide, back, v1 - 0.03 * wide),
        _oval(centre, v, a, b),
        _oval(centre + 0.04 * deep, v, 0.68 * a, 0.62 * b),
    ]


def _urinal(box: Box) -> Lines:
    """A bowl that is straight at the wall and round before it, with its drain."""
    u0, v0, u1, v1 = box
    v, half = (v0 + v1) / 2, (v1 - v0) / 2
    straight = max(u1 - half, u0 + 0.35 * (u1 - u0))
    round_part = np.column_stack([straight + (u1 - straight) * np.cos(_HALF), v + half * np.sin(_HALF)])
    drain = _oval(straight, v, 0.16 * half, 0.16 * half)
    return [np.vstack([(u0, v0), round_part, (u0, v1), (u0, v0)]), drain]


def _sink(box: Box) -> Lines:
    """A basin, the tap at the wall."""
    u0, v0, u1, v1 = box
    deep, wide, v = u1 - u0, v1 - v0, (v0 + v1) / 2
    centre = u0 + 0.57 * deep
    tap = np.array([(u0 + 0.08 * deep, v), (u0 + 0.42 * deep, v)])
    return [
        _rect(*box),
        _oval(centre, v, 0.34 * deep, min(0.40 * wide, 0.55 * deep)),
        tap,
        _oval(centre, v, 0.04 * deep, 0.04 * deep),
    ]


def _mirror(box: Box) -> Lines:
    """Hatching in front of the glass: a mirror is too thin to be seen by itself."""
    _, v0, u1, v1 = box
    count = max(3, round((v1 - v0) / 0.12))
    step = (v1 - v0) / count
    ticks = [np.array([(u1, v0 + step * k), (u1 + 0.05, v0 + step * k + 0.5 * step)]) for k in range(count)]
    return [np.array([(u1, v0), (u1, v1)]), *ticks]


def _cross(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    return [np.array([(u0, v0), (u1, v1)]), np.array([(u0, v1), (u1, v0)])]


def _trash(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    radius = min(u1 - u0, v1 - v0) / 2
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    return [_oval(u, v, 0.9 * radius, 0.9 * radius), _oval(u, v, 0.55 * radius, 0.55 * radius)]


def _dispenser(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    return [np.array([(u0 + 0.6 * (u1 - u0), v0), (u0 + 0.6 * (u1 - u0), v1)])]


def _radiator(box: Box) -> Lines:
    """Its fins."""
    u0, v0, u1, v1 = box
    count = max(3, round((v1 - v0) / 0.1))
    return [np.array([(u0, v), (u1, v)]) for v in np.linspace(v0, v1, count + 1)[1:-1].tolist()]


def _chair(box: Box) -> Lines:
    """A seat, the back at its rear."""
    u0, v0, u1, v1 = _inset(box, 0.06)
    back = u0 + 0.18 * (u1 - u0)
    return [_rect(u0, v0, back, v1), _rect(back, v0 + 0.06 * (v1 - v0), u1, v1 - 0.06 * (v1 - v0))]


def _sofa(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    back, arm = u0 + 0.28 * (u1 - u0), 0.1 * (v1 - v0)
    seats = [np.array([(back, v), (u1, v)]) for v in np.linspace(v0 + arm, v1 - arm, 3).tolist()]
    return [np.array([(back, v0 + arm), (back, v1 - arm)]), *seats]


def _bed(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    fold = u0 + 0.35 * (u1 - u0)
    return [_rect(*_inset((u0, v0, u0 + 0.25 * (u1 - u0), v1), 0.2)), np.array([(fold, v0), (fold, v1)])]


def _cupboard(box: Box) -> Lines:
    """One diagonal: something tall that opens."""
    return _cross(box)[:1]


def _shelf(box: Box) -> Lines:
    u0, v0, u1, v1 = box
    u = u0 + 0.5 * (u1 - u0)
    return [np.array([(u, v0), (u, v1)])]


def _table(box: Box) -> Lines:
    """A thin inner edge."""
    return [_rect(*_inset(box, 0.06))]


FURNITURE: Mapping[str, Callable[[Box], Lines]] = {
    "armchair": _sofa,
    "chair": _chair,
    "stool": _trash,
    "sofa": _sofa,
    "couch": _sofa,
    "bed": _bed,
    "shelf": _shelf,
    "shelves": _shelf,
    "bookcase": _shelf,
    "cupboard": _cupboard,
    "cabinet": _cupboard,
    "wardrobe": _cupboard,
    "locker": _cupboard,
    "desk": _table,
    "table": _table,
    "counter": _table,
}

SYMBOLS: Mapping[str, Callable[[Box], Lines]] = {
    "toilet": _toilet,
    "urinal": _urinal,
    "sink": _sink,
    "mirror": _mirror,
    "column": _cross,
    "trash": _trash,
    "dispenser": _dispenser,
    "radiator": _radiator,
}
