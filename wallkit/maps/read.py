"""A document -> the semantic map in it: builds what can be built, and leaves judging the rest to the rules."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.errors import MapError
from wallkit.maps.classes import DEFAULT_TAXONOMY, TAXONOMIES, ClassInfo, class_from_name
from wallkit.maps.document import Document, Element, wk
from wallkit.maps.grammar import LIDAR_BEHAVIOURS, SHAPES, SURVEYED
from wallkit.maps.model import MAP_LINK, SemanticMap
from wallkit.maps.nouns import DoorState, Header, Joint, Link, MeshFile, Mimic, Opening, Room, Shape, ShapeKind, Survey
from wallkit.maps.numbers import number_from_text, numbers_from_text

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]*:")


def load_map(path: Path) -> SemanticMap:
    """The map in a file, for work that needs it sound: localizing, exporting, drawing.

    Raises:
        MapError: it cannot be read, or rules of the groups X, S or G find errors in it (the first one is the message).
    """
    from wallkit.maps.rules import validate

    try:
        data = path.read_bytes()
    except OSError as error:
        raise MapError(f"cannot read the map: {error.strerror}", where=path, hint="name a .wkmap.urdf file") from error
    report = validate(data, source=str(path), select=("X", "S", "G"))
    errors = [finding for finding in report.findings if finding.severity == "error"]
    if errors or report.map is None:
        first = errors[0]
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise MapError(
            f"{first.code} {first.message}{more}",
            where=f"{path}:{first.line}:{first.column}",
            hint=first.hint or f"wallkit map validate {path}",
        )
    return report.map


def read_map(document: Document) -> SemanticMap:
    """Everything the document says, as nouns. Duplicates, missing partners and unreadable numbers are kept for the rules.

    Raises:
        MapError: the XML could not be read, so there is nothing to build from.
    """
    if document.root is None:
        raise MapError("the XML cannot be read", where=document.source, hint="see `wallkit map validate`")
    root = document.root
    header_element = root.find(wk("map"))
    rows = tuple(_class_row(element) for element in header_element.findall(wk("class"))) if header_element else ()
    header = _header(root, header_element)
    taxonomy = TAXONOMIES.get(header.taxonomy or DEFAULT_TAXONOMY, {})
    folder = Path(document.source).parent
    return SemanticMap(
        document=document,
        name=root.get("name") or "",
        header=header,
        classes={**taxonomy, **{row.name: row for row in reversed(rows)}},
        all_classes=rows,
        all_rooms=tuple(_room(element) for element in header_element.findall(wk("room"))) if header_element else (),
        all_links=tuple(_link(element, folder) for element in root.findall("link")),
        all_joints=tuple(_joint(element) for element in root.findall("joint")),
    )


def transform_from_origin(origin: Element | None) -> Float64Array:
    """The (4, 4) matrix of an <origin xyz rpy>: R = Rz(yaw) Ry(pitch) Rx(roll); identity without one, NaN if unreadable."""
    T = np.eye(4)
    if origin is None:
        return T
    xyz = _vector(origin.get("xyz"), (0.0, 0.0, 0.0))
    rpy = _vector(origin.get("rpy"), (0.0, 0.0, 0.0))
    if xyz is None or rpy is None:
        return np.full((4, 4), np.nan)
    T[:3, 3] = xyz
    if any(rpy):
        (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in rpy)
        T[:3, :3] = (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
    return T


def mesh_file(filename: str, folder: Path) -> MeshFile:
    """Where a mesh's file is, seen from the map's folder; only names in or below that folder lead anywhere."""
    if _URL.match(filename):
        scheme = filename.partition(":")[0]
        return MeshFile(filename, None, f"{scheme}:// names no file beside the map")
    if not filename or filename.startswith(("/", "\\")):
        return MeshFile(filename, None, "absolute path" if filename else "no file name")
    path = folder / filename
    if "\0" in filename or not path.resolve().is_relative_to(folder.resolve()):
        return MeshFile(filename, None, "leaves the map's folder")
    return MeshFile(filename, path)


# -------------------------------------------------------------------------------------------- details


def _header(root: Element, element: Element | None) -> Header:
    check = next((found for place in (root, element) if place and (found := place.find(wk("check")))), None)
    limits = check.get if check else lambda _: None
    get = element.get if element else lambda _: None
    survey = element.find(wk("origin")) if element else None
    return Header(
        format=get("format") or "",
        units=get("units") or "",
        level=get("level") or "",
        elevation_m=number_from_text(get("elevation")),
        scan_plane_m=number_from_text(get("scan_plane")),
        taxonomy=get("taxonomy") or "",
        created=get("created") or "",
        source=get("source") or "",
        sigma_m=number_from_text(get("sigma")),
        max_range_m=number_from_text(limits("max-range")),
        robot_radius_m=number_from_text(limits("robot-radius")),
        labels=limits("labels") or "",
        survey=_survey(survey) if survey else None,
        element=element,
    )


def _survey(element: Element) -> Survey:
    east = numbers_from_text(element.get("east"), 1, largest=SURVEYED.largest)
    north = numbers_from_text(element.get("north"), 1, largest=SURVEYED.largest)
    return Survey(
        kind=element.get("kind") or "none",
        epsg=next(iter(integers_from_text(element.get("epsg") or "")), None),
        east_m=east[0] if east else None,
        north_m=north[0] if north else None,
        yaw_rad=number_from_text(element.get("yaw")),
        element=element,
    )


def _class_row(element: Element) -> ClassInfo:
    lidar = element.get("lidar") or "opaque"
    builtin = TAXONOMIES[DEFAULT_TAXONOMY].get(element.get("name") or "")
    return ClassInfo(
        name=element.get("name") or "",
        seg=integers_from_text(element.get("seg") or ""),
        lidar=lidar if lidar in LIDAR_BEHAVIOURS else "opaque",  # type: ignore[arg-type]  # just checked
        p_return=number_from_text(element.get("p_return")),
        movable=element.get("movable") == "true",
        mount=builtin.mount if builtin else "any",
        color=element.get("color") or (builtin.color if builtin else ""),
        merge=element.get("merge") == "true",
        element=element,
    )


def integers_from_text(text: str) -> tuple[int, ...]:
    """The non-negative integers of a list written with spaces or commas; () when any of its words is not one."""
    words = text.replace(",", " ").split()
    return tuple(int(word) for word in words) if all(re.fullmatch(r"[0-9]{1,9}", word) for word in words) else ()


def _room(element: Element) -> Room:
    numbers = numbers_from_text(element.get("floor"))
    floor = None
    if numbers and len(numbers) % 2 == 0 and len(numbers) >= 6:
        floor = np.array(numbers).reshape(-1, 2)
    return Room(element.get("id") or "", element.get("kind") or "", floor, element)


def _link(element: Element, folder: Path) -> Link:
    name = element.get("name") or ""
    said = element.find(wk("object"))
    class_name = (said.get("class") or "") if said else ""
    shapes = [_shape(child, folder) for child in element.children if child.tag == "collision"]
    openings = tuple(_opening(child) for child in element.children if child.tag == wk("opening"))
    solid = tuple(shape for shape in shapes if shape is not None)
    if said is None:
        guess = class_from_name(name) if name != MAP_LINK else None
        return Link(name, guess or "", True, solid, openings, element)
    return Link(
        name=name,
        class_name=class_name or class_from_name(name) or "",
        class_is_inferred=not class_name,
        shapes=solid,
        openings=openings,
        element=element,
        connects=tuple((said.get("connects") or "").split()),
        separates=tuple((said.get("separates") or "").split()),
        room=said.get("room") or "",
        sigma_m=number_from_text(said.get("sigma")),
        source=said.get("source") or "",
        note=said.get("note") or "",
        semantics=said,
    )


def _shape(collision: Element, folder: Path) -> Shape | None:
    geometry = collision.find("geometry")
    body = next((child for child in geometry.children if child.tag in SHAPES), None) if geometry else None
    if body is None:
        return None
    mesh = mesh_file(body.get("filename") or "", folder) if body.tag == "mesh" else None
    kind: ShapeKind = body.tag  # type: ignore[assignment]  # one of SHAPES
    return Shape(
        kind=kind,
        size=_size(body),
        T_link_shape=transform_from_origin(collision.find("origin")),
        name=collision.get("name") or "",
        element=collision,
        geometry=body,
        mesh=mesh,
    )


def _size(body: Element) -> Float64Array:
    if body.tag == "box":
        return _array(numbers_from_text(body.get("size"), 3), 3)
    if body.tag == "mesh":
        return _array(_vector(body.get("scale"), (1.0, 1.0, 1.0)), 3)
    names = ("radius", "length") if body.tag == "cylinder" else ("radius",)
    numbers = [number_from_text(body.get(name)) for name in names]
    return np.array([np.nan if number is None else number for number in numbers])


def _opening(element: Element) -> Opening:
    along = numbers_from_text(element.get("along"), 2) or (math.nan, math.nan)
    z = numbers_from_text(element.get("z"), 2) or (math.nan, math.nan)
    return Opening(
        id=element.get("id") or "",
        kind=element.get("kind") or "",
        along_m=(along[0], along[1]),
        z_m=(z[0], z[1]),
        fill=element.get("fill") or "",
        swing=element.get("swing") or "",
        element=element,
    )


def _joint(element: Element) -> Joint:
    parts = {child.tag: child for child in reversed(element.children)}
    axis, limit, mimic, state = (parts.get(tag) for tag in ("axis", "limit", "mimic", wk("state")))
    limits = limit.attrs if limit else {}
    return Joint(
        name=element.get("name") or "",
        kind=element.get("type") or "",
        parent=(parts["parent"].get("link") or "") if "parent" in parts else "",
        child=(parts["child"].get("link") or "") if "child" in parts else "",
        T_parent_child=transform_from_origin(parts.get("origin")),
        axis=_array(_vector(axis.get("xyz") if axis else None, (1.0, 0.0, 0.0)), 3),
        element=element,
        lower=number_from_text(limits.get("lower")),
        upper=number_from_text(limits.get("upper")),
        effort=number_from_text(limits.get("effort")),
        velocity=number_from_text(limits.get("velocity")),
        mimic=_mimic(mimic) if mimic else None,
        state=_state(state) if state else None,
    )


def _mimic(element: Element) -> Mimic:
    multiplier = number_from_text(element.get("multiplier") or "1")
    offset = number_from_text(element.get("offset") or "0")
    factor = math.nan if multiplier is None else multiplier
    return Mimic(element.get("joint") or "", factor, math.nan if offset is None else offset, element)


def _state(element: Element) -> DoorState:
    text = element.get("prior") or ""
    return DoorState(
        rest=number_from_text(element.get("rest")),
        prior=prior_from_text(text),
        prior_text=text,
        tolerance=number_from_text(element.get("tolerance")),
        element=element,
    )


def prior_from_text(text: str) -> dict[str, float] | None:
    """{"closed": 0.7, "open": 0.3} from "closed:0.7 open:0.3"; {} from nothing, None when a word is not name:number."""
    prior: dict[str, float] = {}
    for word in text.split():
        name, _, number = word.rpartition(":")
        probability = number_from_text(number)
        if not name or probability is None or name in prior:
            return None
        prior[name] = probability
    return prior


def _vector(text: str | None, default: tuple[float, ...]) -> tuple[float, ...] | None:
    return default if text is None else numbers_from_text(text, len(default))


def _array(numbers: tuple[float, ...] | None, count: int) -> Float64Array:
    return np.array(numbers) if numbers is not None else np.full(count, np.nan)
