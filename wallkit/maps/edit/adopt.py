"""Adopt: a plain URDF -> a semantic map: the header, and the class of every element, guessed from its name and said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from wallkit.errors import closest
from wallkit.maps.classes import DEFAULT_TAXONOMY, TAXONOMIES
from wallkit.maps.document import Edit
from wallkit.maps.draft.xml import attributes, class_line, number_text
from wallkit.maps.edit.changes import Changes, declared, inserted_first, with_attribute
from wallkit.maps.edit.lookup import link_named, refuse
from wallkit.maps.grammar import FORMAT, UNITS
from wallkit.maps.model import MAP_LINK
from wallkit.maps.nouns import Link
from wallkit.maps.rules.base import Context

# elements that nobody can tell are listed up to so many
_LISTED = 10


def adopt(
    context: Context,
    classes: Mapping[str, str] | None = None,
    *,
    level: str = "1",
    elevation_m: float = 0.0,
    scan_plane_m: float | None = None,
) -> Changes:
    """A header where there is none, and a <wk:object> for every link with shapes that has none.

    Args:
        classes: class by link, for those whose name does not tell, or tells wrongly; others are guessed, else "unknown".

    Raises:
        MapError: a link or class that does not exist, or a file whose root is no <robot>.
    """
    if context.root.tag != "robot":
        raise refuse(context, f"<{context.root.name}> is no URDF", "the root of a URDF is <robot>")
    given = dict(classes or {})
    taxonomy = TAXONOMIES[DEFAULT_TAXONOMY]
    known = {**taxonomy, **context.map.classes}
    for name, class_name in given.items():
        link_named(context, name)
        if class_name not in known:
            raise refuse(context, f"there is no class '{class_name}' for '{name}'", closest(class_name, known))
    edits: list[Edit] = []
    said: list[str] = []
    found: dict[str, str] = {}
    unknown: list[str] = []
    for link in context.map.links.values():
        if not _wants_class(link, given):
            continue
        class_name = given.get(link.name) or link.class_name or "unknown"
        if class_name == "unknown" and link.name not in given:
            unknown.append(link.name)
        found[link.name] = class_name
        if link.semantics is not None:
            edits.append(with_attribute(link.semantics, "class", class_name))
        else:
            edits += _without_declaration(
                inserted_first(link.element, [f"<wk:object{attributes(**{'class': class_name})}/>"])
            )
    header = context.map.header.element
    if header is None:
        used = sorted({*found.values(), *(link.class_name for link in context.map.links.values())} & set(taxonomy))
        plane = None if scan_plane_m is None else number_text(scan_plane_m)
        words = {
            "format": FORMAT,
            "units": UNITS,
            "up": "z",
            "level": level,
            "elevation": number_text(elevation_m),
            "scan_plane": plane,
            "taxonomy": DEFAULT_TAXONOMY,
        }
        lines = [f"  <wk:map{attributes(**words)}>", *(class_line(taxonomy[name]) for name in used), "  </wk:map>"]
        edits += _without_declaration(inserted_first(context.root, lines))
        said.append(f"header: added, format {FORMAT}, metres and radians, level {level}, {len(used)} classes")
    if (edits and found) or header is None:
        edits += declared(context.document)
    counts = Counter(found.values())
    for class_name, count in sorted(counts.items(), key=lambda pair: (-pair[1], pair[0])):
        example = next(name for name, one in found.items() if one == class_name)
        how = "as said" if example in given else "not told by its name" if class_name == "unknown" else "by its name"
        said.append(f"{class_name}: {count} link{'s' * (count > 1)}, as {example} ({how})")
    if unknown:
        more = f" and {len(unknown) - _LISTED} more" if len(unknown) > _LISTED else ""
        said.append(f"nothing tells what these are: {', '.join(unknown[:_LISTED])}{more}; say it: --class NAME=CLASS")
    return Changes(tuple(edits), tuple(said))


# ------------------------------------------------------------------------------------------------- details


def _wants_class(link: Link, given: Mapping[str, str]) -> bool:
    if link.name in given:
        return True
    return (
        link.class_is_inferred
        and link.name != MAP_LINK
        and any(child.tag in ("collision", "visual") for child in link.element.children)
    )


def _without_declaration(edits: tuple[Edit, ...]) -> tuple[Edit, ...]:
    """The insertion alone: one declaration of the namespace is made for all."""
    return edits[:1]
