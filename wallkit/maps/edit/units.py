"""Scale: every length of a map, or of one element, by a factor, because it was written in another unit."""

from __future__ import annotations

import math
from collections.abc import Iterable

from wallkit.maps.document import Edit, Element, wk
from wallkit.maps.draft.xml import number_text
from wallkit.maps.edit.changes import Changes, renumbered
from wallkit.maps.edit.lookup import link_named, refuse
from wallkit.maps.grammar import TAGS
from wallkit.maps.numbers import numbers_from_text
from wallkit.maps.rules.base import Context

# what the header says of the building, the LiDAR and the survey is not drawn: it stays
_STAYS = (wk("map"), wk("check"), wk("origin"))
# numbers in the file may be of a unit a thousand times smaller, and so a thousand times larger than a map's
_LARGEST = 1e12


def scale(context: Context, factor: float, names: Iterable[str] = ()) -> Changes:
    """Everything times a factor: boxes, places, openings, floors, travel of what slides; of single elements their shapes.

    The header's elevation, scan plane and survey stay: they are not drawn.

    Raises:
        MapError: the factor is not a positive number, or there is no such element.
    """
    if not (math.isfinite(factor) and factor > 0) or factor == 1:
        raise refuse(context, f"a factor of {factor:g} repairs nothing", "0.001 from millimetres, 0.0254 from inches")
    chosen = [link_named(context, name) for name in names]
    roots: list[Element] = [link.element for link in chosen] or [context.root]
    sliding = {id(joint.element) for joint in context.map.all_joints if joint.kind == "prismatic"}
    edits: list[Edit] = []
    for root in roots:
        for element in root.iter():
            if element.tag in TAGS and element.tag not in _STAYS:
                edits += _scaled(
                    element, factor, is_sliding=element.parent is not None and id(element.parent) in sliding
                )
    said = f"{link_count(len(chosen), len(context.map.links))}: {len(edits)} numbers times {factor:g}"
    lines = [said, *_extents(context, factor, [link.name for link in chosen])]
    if not chosen:
        header = context.map.header
        kept = (("elevation", header.elevation_m), ("scan plane", header.scan_plane_m))
        stays = [f"{what} {number_text(value)} m" for what, value in kept if value is not None]
        lines += [f"header: {', '.join(stays)} stay{'s' * (len(stays) == 1)}"] if stays else []
    return Changes(tuple(edits), tuple(lines))


def link_count(chosen: int, links: int) -> str:
    """Whose numbers change."""
    return f"{chosen} element{'s' * (chosen > 1)}" if chosen else f"all {links} links"


def _scaled(element: Element, factor: float, *, is_sliding: bool) -> Iterable[Edit]:
    for key, value in TAGS[element.tag].attributes.items():
        is_length = value.kind in ("numbers", "pairs") and value.unit == "m"
        is_length |= (element.tag, key) == ("mesh", "scale")
        is_length |= is_sliding and (element.tag, key) in (
            ("limit", "lower"),
            ("limit", "upper"),
            (wk("state"), "rest"),
            (wk("state"), "tolerance"),
        )
        attribute = element.attribute(key) if is_length and key in element.attrs else None
        numbers = numbers_from_text(attribute.value, largest=_LARGEST) if attribute is not None else None
        if attribute is not None and numbers is not None:
            yield from renumbered(attribute, [number * factor for number in numbers])
    if element.tag == "mesh" and "scale" not in element.attrs:
        at = element.attributes[-1].span.end if element.attributes else element.offset + len("<mesh")
        yield Edit(at, 0, f' scale="{" ".join([number_text(factor)] * 3)}"'.encode())


def _extents(context: Context, factor: float, names: list[str]) -> Iterable[str]:
    """How large it was and is."""
    import numpy as np

    wanted = set(names)
    corners = [part.corners for part in context.parts if not wanted or part.link in wanted]
    if not corners:
        return
    points = np.concatenate(corners)
    size = points.max(axis=0) - points.min(axis=0)
    before, after = (" x ".join(f"{value:.5g}" for value in (size * f).tolist()) for f in (1.0, factor))
    yield f"{'its' if len(names) == 1 else 'their' if names else 'the'} extent: {before} -> {after} m"
