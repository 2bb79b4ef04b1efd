"""C, the model's labels: the classes of the map and those of the segmentation model mean the same things.

The labels come from `--labels FILE` or from <wk:check labels>, a file beside the map. Without them nothing is asked here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wallkit.errors import MapError, closest
from wallkit.maps.classes import ClassInfo
from wallkit.maps.document import Attribute, Element, wk
from wallkit.maps.labels import Labels, read_labels
from wallkit.maps.nouns import Link
from wallkit.maps.read import mesh_file
from wallkit.maps.rules.base import Context, Problem, Rule
from wallkit.maps.rules.taxonomy import class_spot, used_classes


@dataclass(frozen=True, slots=True)
class _Found:
    """The labels, or what keeps them from being read, and where the map names their file."""

    labels: Labels
    trouble: str = ""
    at: Attribute | Element | None = None


def labels_of(context: Context) -> _Found:
    """The labels given, else those of the file that the map names."""
    if context.labels:
        return _Found(context.labels)
    name = context.map.header.labels
    check = next((element for element in context.root.iter() if element.tag == wk("check")), None)
    if not name or check is None:
        return _Found({})
    # as for meshes: a map names only files in its own folder
    file = mesh_file(name, Path(context.document.source).parent)
    if file.path is None:
        return _Found({}, f"labels '{name}': {file.problem}", check.spot("labels"))
    try:
        return _Found(read_labels(file.path))
    except MapError as error:
        return _Found({}, f"labels '{name}': {error.message}", check.spot("labels"))


def c004_not_a_label(context: Context) -> Iterator[Problem]:
    """A class of the map is none of the model's labels, or its id means another label.

    A beam labelled `door` is scored against what the map calls doors; a class without a label is never scored so. A class
    means the labels of its ids (seg), and without ids the label of its own name.

    Bad: with labels wall and door, a <wk:object class="sink"/>
    Good: with labels wall, door and sink, a <wk:object class="sink"/>
    """
    found = context.once(labels_of)
    if found.at is not None:
        yield Problem(found.at, found.trouble, "a file beside the map, one class a line")
    if not found.labels:
        return
    ids = {label: number for number, label in found.labels.items()}
    for name, link in context.once(used_classes).items():
        info = context.map.classes[name]
        spot = _spot(info, link)
        if not info.seg and name not in ids:
            message = f"class '{name}' is none of the model's {len(ids)} labels"
            yield Problem(spot, message, f'{closest(name, ids)}; seg="..." in its <wk:class> names other labels')
        elif info.seg and name in ids and ids[name] not in info.seg:
            meant = ", ".join(f"{number} is '{found.labels[number]}'" for number in info.seg if number in found.labels)
            message = f"class '{name}' has seg {' '.join(map(str, info.seg))}, but the model's '{name}' is {ids[name]}"
            yield Problem(spot, message + (f" ({meant})" if meant else ""), f'seg="{ids[name]}"')


def c006_unused_label(context: Context) -> Iterator[Problem]:
    """A label of the model is never met in the map: beams labelled so tell nothing here. All of them in one finding.

    Bad: with labels wall and sofa, a map of walls only
    Good: with label wall, a map of walls only
    """
    labels = context.once(labels_of).labels
    used = context.once(used_classes)
    meant = {number for name in used for number in context.map.classes[name].seg}
    unused = [label for number, label in sorted(labels.items()) if number not in meant and label not in used]
    if unused:
        shown = ", ".join(unused[:8]) + (f" and {len(unused) - 8} more" if len(unused) > 8 else "")
        header = context.map.header.element
        message = f"{len(unused)} of the model's {len(labels)} labels are nothing in this map: {shown}"
        yield Problem(header or context.root, message, detail={"labels": unused})


def c008_seg_range(context: Context) -> Iterator[Problem]:
    """A class names an id that the model does not have.

    Bad: with labels wall and door, a <wk:class name="sink" seg="5"/>
    Good: with labels wall and door, a <wk:class name="door" seg="1"/>
    """
    labels = context.once(labels_of).labels
    for row in context.map.all_classes if labels else ():
        outside = [number for number in row.seg if number not in labels]
        if outside and row.element is not None:
            message = f"class '{row.name}' has seg {', '.join(map(str, outside))}; the model's ids are {_ids(labels)}"
            number = next((n for n, label in labels.items() if label == row.name), None)
            hint = f'seg="{number}"' if number is not None else "leave seg out where no label means this class"
            yield Problem(row.element.spot("seg"), message, hint)


# -------------------------------------------------------------------------------------------- details


def _spot(info: ClassInfo, link: Link) -> Attribute | Element:
    if info.element is not None:
        return info.element.spot("seg" if info.seg else "name")
    return class_spot(link)


def _ids(labels: Labels) -> str:
    low, high = min(labels), max(labels)
    return f"{low} to {high}" if len(labels) == high - low + 1 else ", ".join(map(str, sorted(labels)))


RULES = (
    Rule("WK-C004", "error", c004_not_a_label, blocks=False),
    Rule("WK-C006", "info", c006_unused_label),
    Rule("WK-C008", "error", c008_seg_range, blocks=False),
)
