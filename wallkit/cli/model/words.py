"""Words that several `wallkit model` commands take: sizes, and lists of numbers."""

from __future__ import annotations

import click


def size_from_words(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """(height, width) of "320" or "192x320"."""
    if value is None:
        return None
    try:
        sides = [int(part) for part in value.lower().split("x")]
    except ValueError:
        sides = []
    if len(sides) not in (1, 2) or min(sides) < 1:
        raise click.BadParameter(f"'{value}' is no size: 320, or 192x320 for height x width")
    return sides[0], sides[-1]


def sizes_from_words(ctx: click.Context, parameter: click.Parameter, value: str) -> tuple[tuple[int, int], ...]:
    """Several of them, with commas between; none of an empty text."""
    found = (size_from_words(ctx, parameter, part.strip()) for part in value.split(",") if part.strip())
    return tuple(size for size in found if size is not None)
