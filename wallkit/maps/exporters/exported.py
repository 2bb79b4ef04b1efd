"""What an exporter is asked and what it answers: options, files not yet written, and what the format has no place for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from wallkit.errors import Finding, MapError
from wallkit.maps.model import DoorPosition, SemanticMap
from wallkit.maps.nouns import Link

Doors = Literal["rest", "closed", "open", "prior"]
Crs = Literal["local", "epsg", "wgs84"]


@dataclass(frozen=True)
class ExportOptions:
    """What the user decides; None is the format's own custom.

    Attributes:
        z_m: height of the cut above the floor; None: the map's scan plane, or no cut where a format needs none.
        cell_m: side of a raster's cell. doors: where the leaves stand; "prior" draws them as probabilities.
        is_solid: the insides of walls are occupied too, not only what free space sees.
        crs: of GeoJSON's coordinates.
    """

    z_m: float | None = None
    cell_m: float | None = None
    doors: Doors | None = None
    is_solid: bool = False
    crs: Crs = "local"


@dataclass(frozen=True)
class Exported:
    """Files by path, not yet written, and what the user should know about them.

    Notes carry one of the codes export.wrote (what is in the files), export.taken (how something was understood) and
    export.lost (what of the map the format cannot say).
    """

    files: Mapping[Path, bytes]
    notes: tuple[Finding, ...]


@dataclass(frozen=True)
class Exporter:
    """One format.

    Attributes:
        write: a map and the path named by the user -> the files; nothing is written.
        suffixes: of paths that can only mean this format; the first is the usual one.
        options: fields of ExportOptions that it heeds.
        is_folder: the path is a folder that holds nothing else.
    """

    write: Callable[[SemanticMap, Path, ExportOptions], Exported]
    suffixes: tuple[str, ...]
    options: frozenset[str] = frozenset()
    is_folder: bool = False


@dataclass
class Notes:
    """The notes of one export, collected; what is lost is counted by its kind."""

    source: str
    format_name: str
    found: list[Finding] = field(default_factory=list)
    lost: Counter[str] = field(default_factory=Counter)

    def wrote(self, message: str, **detail: Any) -> None:
        self.found.append(Finding("export.wrote", "info", self.source, message, detail=detail))

    def taken(self, message: str, *, hint: str = "", **detail: Any) -> None:
        self.found.append(Finding("export.taken", "info", self.source, message, hint=hint, detail=detail))

    def lose(self, one: str, count: int, *, many: str = "") -> None:
        """Count things that the format cannot say: "height", and of several "heights" or what `many` says."""
        if count:
            self.lost[one if count == 1 else many or f"{one}s"] += count

    def all(self) -> tuple[Finding, ...]:
        """The notes in order, the losses as one at the end."""
        if not self.lost:
            return tuple(self.found)
        counted = ", ".join(f"{count} {what}" for what, count in self.lost.items())
        verb = "is" if sum(self.lost.values()) == 1 else "are"
        message = f"{counted} {verb} not part of {self.format_name}"
        return (*self.found, Finding("export.lost", "warning", self.source, message, detail=dict(self.lost)))


def things(semantic_map: SemanticMap) -> list[Link]:
    """The links that are something: all but bare frames."""
    return [link for link in semantic_map.links.values() if link.class_name or link.shapes or link.openings]


def height_of(semantic_map: SemanticMap, options: ExportOptions) -> float:
    """The height of the cut.

    Raises:
        MapError: neither the user nor the map names one.
    """
    z_m = semantic_map.header.scan_plane_m if options.z_m is None else options.z_m
    if z_m is None:
        raise MapError(
            "the map does not say at which height the LiDAR cuts it",
            where=semantic_map.source,
            hint='--z 0.30, or <wk:map scan_plane="0.30" ...> in the map',
        )
    return z_m


def doors_of(semantic_map: SemanticMap, options: ExportOptions) -> DoorPosition:
    """Where the leaves stand in a format that cannot draw them as probabilities: as asked, else at rest.

    Raises:
        MapError: as probabilities was asked.
    """
    if options.doors == "prior":
        raise MapError(
            "doors cannot be drawn as probabilities here",
            where=semantic_map.source,
            hint="--doors closed, open or rest; --doors prior is for --format pgm",
        )
    return options.doors or "rest"


def lose_meaning(notes: Notes, semantic_map: SemanticMap, *, but: Iterable[str] = ()) -> None:
    """Count what no other format has: beliefs about doors, LiDAR behaviours, rooms, openings, survey, accuracies.

    Args:
        but: those kinds (the keys below) that this format does say.
    """
    links = things(semantic_map)
    behaviours = {link.class_name for link in links if (info := semantic_map.class_of(link.name)) and _is_odd(info)}
    counts = {
        "class": len({link.class_name for link in links if link.class_name}),
        "LiDAR behaviour": len(behaviours),
        "room": len(semantic_map.rooms),
        "declared opening": sum(len(link.openings) for link in links),
        "prior": sum(bool(joint.state and joint.state.prior) for joint in semantic_map.joints.values()),
        "accuracy": sum(link.sigma_m is not None for link in links),
        "survey origin": int(semantic_map.header.survey is not None),
    }
    for one, count in counts.items():
        if one not in but:
            notes.lose(one, count, many=_PLURALS.get(one, ""))


_PLURALS = {"class": "classes", "accuracy": "accuracies"}


def _is_odd(info: Any) -> bool:
    """Whether a class is not simply opaque."""
    return bool(info.lidar != "opaque" or info.p_return not in (None, 1.0))
