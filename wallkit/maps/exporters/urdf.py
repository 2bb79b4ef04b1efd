"""A map -> the same URDF with visuals, coloured by class: insertions only, every byte that was there stays.

Visuals copy the collisions they stand for. RViz and yourdfpy draw visuals alone, and a map needs none for itself (WK-P007).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import Edit, Element, apply_edits, escaped
from wallkit.maps.exporters.colors import rgba_of
from wallkit.maps.exporters.exported import Exported, ExportOptions, Notes
from wallkit.maps.importers.imported import Names
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Link, Shape

PREFIX = "class_"


def export_urdf(semantic_map: SemanticMap, out: Path, options: ExportOptions) -> Exported:
    """The map with a <visual> for every collision of links that have none, and a <material> for every class."""
    notes = Notes(semantic_map.source, "URDF")
    document, root = semantic_map.document, semantic_map.document.root
    assert root is not None, "a sound map has a root"
    names = _taken_names(root)
    own = {link.name for link in semantic_map.links.values() if link.element.find("visual")}
    painted = [link for link in semantic_map.links.values() if link.shapes and link.name not in own]
    used = dict.fromkeys(link.class_name for link in painted)
    materials = {of: names.take(f"{PREFIX}{of or 'unknown'}") for of in used}
    edits = [edit for link in painted for edit in _visuals(link, materials[link.class_name], names)]
    first = next((child for child in root.children if child.tag in ("link", "joint")), None)
    if first is not None and materials:
        rows = [_material(name, semantic_map.classes.get(of), of) for of, name in materials.items()]
        indent = _indent_of(first)
        text = "".join(f"{row}{indent}" for row in rows)
        edits.append(Edit(first.offset, 0, text.encode(document.encoding)))
    count = sum(len(link.shapes) for link in painted)
    notes.wrote(f"{count} visuals on {len(painted)} links, {len(materials)} materials", visuals=count)
    if own:
        notes.taken(f"{len(own)} links have visuals of their own and keep them")
    return Exported({out: apply_edits(document.data, edits)}, notes.all())


def _visuals(link: Link, material: str, names: Names) -> Iterator[Edit]:
    for number, shape in enumerate(link.shapes, start=1):
        name = names.take(f"{shape.name or f'{link.name}.{number}'}.visual")
        encoding = shape.element.document.encoding
        text = f"{_indent_of(shape.element)}{_visual(shape, name, material)}"
        yield Edit(shape.element.span.end, 0, text.encode(encoding))


def _visual(shape: Shape, name: str, material: str) -> str:
    document = shape.element.document
    copied = [child for tag in ("origin", "geometry") if (child := shape.element.find(tag))]
    inside = "".join(document.slice(child.span) for child in copied)
    return f'<visual name="{escaped(name)}">{inside}<material name="{escaped(material)}"/></visual>'


def _material(name: str, info: ClassInfo | None, class_name: str) -> str:
    rgba = " ".join(f"{value:.3g}" for value in rgba_of(info, class_name))
    return f'<material name="{escaped(name)}"><color rgba="{rgba}"/></material>'


def _indent_of(element: Element) -> str:
    """The line end and white space before an element; a plain line end where it does not begin its line."""
    data, encoding = element.document.data, element.document.encoding
    start = max(data.rfind(b"\n", 0, element.offset), data.rfind(b"\r", 0, element.offset))
    before = data[start + 1 : element.offset] if start >= 0 else b"<"
    if before.strip():
        return ""
    line_end = "\r\n" if b"\r\n" in data else "\n"
    return line_end + before.decode(encoding)


def _taken_names(root: Element) -> Names:
    """Names that are in use anywhere in the file: MuJoCo renames what is not unique (WK-P006)."""
    names = Names()
    for element in root.iter():
        if name := element.get("name"):
            names.take(name)
    return names
