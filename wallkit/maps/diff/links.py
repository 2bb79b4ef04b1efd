"""One link in two maps -> what changed about it: place, class, shapes, openings, and the joint it hangs on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wallkit.core.types import Float64Array
from wallkit.maps.diff.changes import Change, Moved, number_change, number_text, value_change
from wallkit.maps.model import SemanticMap
from wallkit.maps.nouns import Joint, Link, Opening, Shape


@dataclass(frozen=True, eq=False)
class Side:
    """One of the two maps, with T_map_link (4, 4) of every link at rest."""

    map: SemanticMap
    poses: Mapping[str, Float64Array]

    @classmethod
    def of(cls, semantic_map: SemanticMap) -> Side:
        """The map with its poses worked out."""
        return cls(semantic_map, semantic_map.poses())

    def pose(self, link: str) -> Float64Array | None:
        """T_map_link with the link's own joint at zero, so that how a door stands is no motion; None if it hangs loose."""
        joint = self.map.parent_joint(link)
        if joint is None:
            return self.poses.get(link)
        parent = self.poses.get(joint.parent)
        return None if parent is None else parent @ joint.T_parent_child


def link_changes(a: Side, b: Side, old: str, new: str, names: Mapping[str, str], tolerance: float) -> list[Change]:
    """Everything about one link; `names` says which links were renamed to what."""
    before, after = a.map.links[old], b.map.links[new]
    found = [*_place_changes(a, b, old, new, names, tolerance)]
    found += value_change("link", new, "class", _class_text(before), _class_text(after))
    for field in ("separates", "connects", "room", "source", "note"):
        found += value_change("link", new, field, getattr(before, field), getattr(after, field))
    found += number_change("link", new, "sigma", (before.sigma_m, after.sigma_m), "m", tolerance)
    found += _shape_changes(before, after, tolerance)
    found += _opening_changes(before, after, names, tolerance)
    joints = a.map.parent_joint(old), b.map.parent_joint(new)
    if joints[0] is not None and joints[1] is not None:
        found += _joint_changes(joints[0], joints[1], new, tolerance)
    return found


def renamed_links(a: Side, b: Side, tolerance: float) -> dict[str, str]:
    """{old: new} of links that are the same thing at the same place under another name."""
    waiting: dict[tuple[object, ...], list[str]] = {}
    for name, link in b.map.links.items():
        if name not in a.map.links:
            waiting.setdefault(_kind_of(link), []).append(name)
    found: dict[str, str] = {}
    for name, link in a.map.links.items():
        if name in b.map.links:
            continue
        candidates = waiting.get(_kind_of(link), [])
        here = a.pose(name)
        for other in candidates:
            there = b.pose(other)
            is_bare = not link.shapes and not link.openings
            if here is None or there is None or is_bare:
                continue
            if np.abs(here - there).max() <= tolerance and _same_shapes(
                link.shapes, b.map.links[other].shapes, tolerance
            ):
                found[name] = other
                candidates.remove(other)
                break
    return found


# -------------------------------------------------------------------------------------------- details


def _class_text(link: Link) -> str:
    return f"{link.class_name or 'none'} (not said, from its name)" if link.class_is_inferred else link.class_name


def _kind_of(link: Link) -> tuple[object, ...]:
    return link.class_name, len(link.shapes), len(link.openings), tuple(shape.kind for shape in link.shapes)


def _same_shapes(a: Sequence[Shape], b: Sequence[Shape], tolerance: float) -> bool:
    return all(
        _is_close(x.size, y.size, tolerance) and _is_close(x.T_link_shape, y.T_link_shape, tolerance)
        for x, y in zip(a, b, strict=True)
    )


def _is_close(a: Float64Array, b: Float64Array, tolerance: float) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=0.0, atol=tolerance, equal_nan=True))


def _place_changes(
    a: Side, b: Side, old: str, new: str, names: Mapping[str, str], tolerance: float
) -> Iterator[Change]:
    """Where it hangs, and whether it moved by itself: what its parent carries along did not."""
    before, after = a.map.parent_joint(old), b.map.parent_joint(new)
    parents = ["" if joint is None else joint.parent for joint in (before, after)]
    was = names.get(parents[0], parents[0])
    if was != parents[1]:
        yield from value_change("link", new, "hangs on", was, parents[1])
    if before is None or after is None:
        return
    if was == parents[1] and _is_close(before.T_parent_child, after.T_parent_child, tolerance):
        return
    T_before, T_after = a.pose(old), b.pose(new)
    if T_before is None or T_after is None or not np.all(np.isfinite([T_before, T_after])):
        yield Change("changed", "link", new, f"{new}: its place changed; where it is cannot be told", "pose")
        return
    moved = Moved.between(T_before, T_after)
    if moved.is_still(tolerance):
        if was == parents[1]:
            yield Change("changed", "link", new, f"{new} stays where it is while {parents[1]} moves", "pose")
        return
    yield Change("moved", "link", new, f"{new} {moved.text}", "pose", detail=moved.detail)


def _shape_changes(before: Link, after: Link, tolerance: float) -> Iterator[Change]:
    olds, news = _by_part(before), _by_part(after)
    for part, shape in olds.items():
        name = f"{after.name}/{part}"
        other = news.get(part)
        if other is None:
            yield Change("removed", "shape", name, f"{after.name}: part {part} removed ({_size_text(shape)})")
            continue
        if shape.kind != other.kind or not _is_close(shape.size, other.size, tolerance):
            texts = [_size_text(shape), _size_text(other)]
            yield _between("shape", name, f"{after.name}: part {part}", "size", texts)
        if not _is_close(shape.T_link_shape, other.T_link_shape, tolerance):
            moved = Moved.between(shape.T_link_shape, other.T_link_shape)
            text = f"{after.name}: part {part} {moved.text} in its link"
            yield Change("moved", "shape", name, text, "origin", detail=moved.detail)
        files = [shape.mesh.filename if shape.mesh else "" for shape in (shape, other)]
        yield from value_change("shape", f"{after.name}: part {part}", "mesh", files[0], files[1], name=name)
    for part, shape in news.items():
        if part not in olds:
            yield Change(
                "added", "shape", f"{after.name}/{part}", f"{after.name}: part {part} added ({_size_text(shape)})"
            )


def _by_part(link: Link) -> dict[str, Shape]:
    """Shapes by their name without the link's, or by their number."""
    found: dict[str, Shape] = {}
    for number, shape in enumerate(link.shapes, start=1):
        name = shape.name.removeprefix(f"{link.name}.") or f"#{number}"
        found[name if name not in found else f"{name}#{number}"] = shape
    return found


def _size_text(shape: Shape) -> str:
    return f"{shape.kind} " + " x ".join(number_text(value) for value in shape.size.tolist())


def _opening_changes(before: Link, after: Link, names: Mapping[str, str], tolerance: float) -> Iterator[Change]:
    olds: dict[str, Opening] = {opening.id: opening for opening in reversed(before.openings)}
    news: dict[str, Opening] = {opening.id: opening for opening in reversed(after.openings)}
    for key, opening in reversed(olds.items()):
        name, said = f"{after.name}/{key}", f"{after.name}: opening {key}"
        other = news.get(key)
        if other is None:
            yield Change("removed", "opening", name, f"{said} removed ({opening.kind})")
            continue
        yield from value_change("opening", said, "kind", opening.kind, other.kind, name=name)
        fill = names.get(opening.fill, opening.fill)
        yield from value_change("opening", said, "fill", fill, other.fill, name=name)
        yield from value_change("opening", said, "swing", opening.swing, other.swing, name=name)
        for field, pair in (("along", (opening.along_m, other.along_m)), ("z", (opening.z_m, other.z_m))):
            if not _is_close(np.array(pair[0]), np.array(pair[1]), tolerance):
                texts = [" ".join(map(number_text, value)) for value in pair]
                yield _between("opening", name, said, field, texts, " m")
    for key, opening in reversed(news.items()):
        if key not in olds:
            along = " to ".join(map(number_text, opening.along_m))
            text = f"{after.name}: opening {key} added ({opening.kind} along {along} m)"
            yield Change("added", "opening", f"{after.name}/{key}", text)


def _between(what: str, name: str, said: str, field: str, texts: Sequence[str], unit: str = "") -> Change:
    text = f"{said}: {field} {texts[0]} -> {texts[1]}{unit}"
    return Change("changed", what, name, text, field, texts[0], texts[1])


def _joint_changes(before: Joint, after: Joint, link: str, tolerance: float) -> Iterator[Change]:
    """Of the joint a link hangs on, said of the link: people know the door, not its hinge."""
    unit = "m" if after.kind == "prismatic" else "rad"

    def numbers(field: str, a: float | None, b: float | None, in_unit: str) -> Iterator[Change]:
        return number_change("joint", link, field, (a, b), in_unit, tolerance)

    yield from value_change("joint", link, "joint type", before.kind, after.kind)
    yield from value_change("joint", link, "joint name", before.name, after.name)
    if not _is_close(before.axis, after.axis, tolerance):
        axes = [" ".join(map(number_text, joint.axis.tolist())) for joint in (before, after)]
        yield _between("joint", link, link, "axis", axes)
    yield from numbers("lower limit", before.lower, after.lower, unit)
    yield from numbers("limit", before.upper, after.upper, unit)
    yield from numbers("effort", before.effort, after.effort, "")
    yield from numbers("velocity", before.velocity, after.velocity, "")
    mimics = [
        "" if joint.mimic is None else f"{joint.mimic.joint} x {joint.mimic.multiplier:g} + {joint.mimic.offset:g}"
        for joint in (before, after)
    ]
    yield from value_change("joint", link, "follows", mimics[0], mimics[1])
    states = before.state, after.state
    rests, tolerances, priors = (
        [None if state is None else getattr(state, field) for state in states]
        for field in ("rest", "tolerance", "prior")
    )
    yield from numbers("rest", rests[0], rests[1], unit)
    yield from numbers("tolerance", tolerances[0], tolerances[1], unit)
    if priors[0] != priors[1] and not _same_prior(priors[0], priors[1], tolerance):
        yield from value_change("joint", link, "prior", priors[0], priors[1])


def _same_prior(a: Mapping[str, float] | None, b: Mapping[str, float] | None, tolerance: float) -> bool:
    if a is None or b is None or set(a) != set(b):
        return False
    return all(abs(a[state] - b[state]) <= tolerance for state in a)
