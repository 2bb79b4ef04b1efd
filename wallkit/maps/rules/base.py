"""What a rule is, what it is given and what it says.

A rule is a generator function over a `Context` that yields a `Problem` for everything it objects to, and nothing where it
cannot judge. Its docstring is its documentation (see `wallkit.maps.rules.docs` for the form). Each group has a module with a
tuple RULES at its bottom, and `wallkit.maps.rules` collects them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from wallkit.core.types import Float64Array
from wallkit.errors import Finding, Severity
from wallkit.maps.document import Attribute, Document, Edit, Element, Span
from wallkit.maps.rules.tolerances import Tolerances

if TYPE_CHECKING:
    from wallkit.maps.audit.nouns import Evidence
    from wallkit.maps.geometry import Part, Slice
    from wallkit.maps.labels import Labels
    from wallkit.maps.model import SemanticMap
    from wallkit.maps.walls import WallEnd, WallRun

FixClass = Literal["safe", "moderate", "risky"]
Where = Element | Attribute | Span
T = TypeVar("T")

# groups of rules in the order they run, with the groups that must be free of blocking errors before
PREREQUISITES: Mapping[str, str] = {
    "X": "",
    "S": "X",
    "G": "XS",
    "E": "XSG",
    "O": "XSGE",
    "T": "XSGE",
    "C": "XS",
    "L": "XSGEOTC",
    "P": "X",
    # of rasters, which are no XML: no other group runs on them, and this one on nothing else
    "R": "",
    # against a log
    "A": "XSG",
}


@dataclass(frozen=True, slots=True)
class Problem:
    """What a rule objects to.

    Attributes:
        at: where to look; an element means its start tag, an attribute its value.
        message: what is wrong, with names and values.
        hint: what to type or change next.
        xyz: (3,) or (2,) place in the map frame, metres.
        related: other places that belong to it, each with what it is ("first defined here").
        edits: the repair, when there is one; its class is the rule's, or `fix`.
        severity: where this one is milder or graver than the rule's.
        detail: figures for JSON.
    """

    at: Where
    message: str
    hint: str = ""
    xyz: tuple[float, ...] = ()
    related: tuple[tuple[str, Where], ...] = ()
    edits: tuple[Edit, ...] = ()
    fix: FixClass | None = None
    severity: Severity | None = None
    detail: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Rule:
    """One check.

    Attributes:
        code: "WK-G001"; its letter is the group, which decides when it runs.
        severity: of its findings, unless a problem says otherwise.
        fix: class of its repairs; None when it never has one.
        blocks: an error of it leaves the later groups nothing sound to judge, so they are skipped.
        is_last: it runs after all others and sees which inline ignores were used.
        needs_log: it judges what a log says about the map, so it only runs where there is a log (`wallkit map audit`).
    """

    code: str
    severity: Severity
    check: Callable[[Context], Iterable[Problem]]
    fix: FixClass | None = None
    blocks: bool = True
    is_last: bool = False
    needs_log: bool = False

    @property
    def group(self) -> str:
        """The letter of its group."""
        return self.code[3]


@dataclass(frozen=True, slots=True)
class Related:
    """Another place that belongs to a finding."""

    message: str
    line: int
    column: int
    offset: int
    length: int
    xpath: str


@dataclass(frozen=True, slots=True)
class Fix:
    """A repair: safe (changes no meaning), moderate (most likely meant) or risky (only ever shown)."""

    kind: FixClass
    edits: tuple[Edit, ...]


@dataclass(frozen=True, slots=True)
class MapFinding(Finding):
    """A finding about a map file, with everything an editor, a reviewer or a repair needs.

    Attributes:
        end_column: of the marked text on its line, exclusive, from 1. offset, length: the marked bytes.
        xpath: of the element; names where there are names.
        xyz: place in the map frame, metres; empty when it is nowhere in particular.
        fingerprint: stays the same while code, element names and order do, whatever the line.
        count: how many findings this one stands for (see `Report.grouped`).
    """

    end_column: int = 0
    offset: int = 0
    length: int = 0
    xpath: str = ""
    xyz: tuple[float, ...] = ()
    related: tuple[Related, ...] = ()
    fix: Fix | None = None
    fingerprint: str = ""
    count: int = 1


@dataclass(frozen=True)
class Context:
    """What every rule is given. The products of geometry are made when a rule first asks, and shared by all.

    Attributes:
        in_set: the file is one level of several.
        labels: of the segmentation model, by id; None when none are given.
        unused_ignores: for rules that run last: (<wk:ignore>, the code in it that matched nothing).
        evidence: what a log says about the map, for the rules of group A; None without a log.
    """

    document: Document
    tolerances: Tolerances = field(default_factory=Tolerances)
    in_set: bool = False
    labels: Labels | None = None
    unused_ignores: list[tuple[Element, str]] = field(default_factory=list)
    evidence: Evidence | None = None
    _made: dict[Callable[[Context], Any], Any] = field(default_factory=dict, repr=False)

    def once(self, make: Callable[[Context], T]) -> T:
        """make(context), made once however many rules ask; for products that only one group of rules needs."""
        if make not in self._made:
            self._made[make] = make(self)
        made: T = self._made[make]
        return made

    @property
    def root(self) -> Element:
        """The root element; rules of group S and later only run when there is one."""
        if self.document.root is None:
            raise ValueError("a rule after group X ran on a file that could not be parsed")
        return self.document.root

    @cached_property
    def map(self) -> SemanticMap:
        """The map as nouns (groups G and later)."""
        from wallkit.maps.read import read_map

        return read_map(self.document)

    @cached_property
    def poses(self) -> dict[str, Float64Array]:
        """T_map_link of every link, everything at rest (groups E and later)."""
        return self.map.poses()

    @cached_property
    def parts(self) -> list[Part]:
        """Every solid part, everything at rest."""
        from wallkit.maps.geometry import parts

        return parts(self.map, poses=self.poses)

    @cached_property
    def parts_by_link(self) -> dict[str, list[Part]]:
        """The parts of each link that has any."""
        by_link: dict[str, list[Part]] = {}
        for part in self.parts:
            by_link.setdefault(part.link, []).append(part)
        return by_link

    @cached_property
    def runs(self) -> list[WallRun]:
        """Every straight run of wall."""
        from wallkit.maps.walls import wall_axes

        return wall_axes(self.map, self.parts)

    @cached_property
    def wall_ends(self) -> list[WallEnd]:
        """Both ends of every run, with the nearest structure (walls, columns, glass) within `gap_max_m`."""
        from wallkit.maps.walls import wall_ends

        fixed = {name for name, info in self.map.classes.items() if info.mount == "structure" and not info.movable}
        structure = [part for part in self.parts if part.class_name in fixed]
        return wall_ends(self.runs, structure, reach_m=self.tolerances.gap_max_m)

    @property
    def scan_plane_m(self) -> float | None:
        """Height of the LiDAR's plane: the setting, else what the map says, else unknown."""
        given = self.tolerances.scan_plane_m
        return self.map.header.scan_plane_m if given is None else given

    @property
    def max_range_m(self) -> float | None:
        """The LiDAR's range, likewise."""
        given = self.tolerances.max_range_m
        return self.map.header.max_range_m if given is None else given

    @property
    def robot_radius_m(self) -> float | None:
        """The robot's radius, likewise."""
        given = self.tolerances.robot_radius_m
        return self.map.header.robot_radius_m if given is None else given

    @cached_property
    def scan_slice(self) -> Slice | None:
        """What the LiDAR's plane cuts, everything at rest; None when its height is unknown."""
        from wallkit.maps.geometry import slice_parts

        return None if self.scan_plane_m is None else slice_parts(self.parts, self.scan_plane_m)
