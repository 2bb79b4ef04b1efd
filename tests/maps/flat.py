"""A flat of two rooms drawn in a test, with one of everything that exporters must say or count."""

from __future__ import annotations

import math

from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftOrigin, DraftPane, DraftRoom, DraftWall
from wallkit.maps.draft.write import write_draft
from wallkit.maps.model import SemanticMap
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse

THICK_M = 0.12
# the axes of the outer walls; the flat's own wall stands at x = 3
WIDE_M, DEEP_M, AT_M = 5.0, 4.0, 3.0
ORIGIN = DraftOrigin("surveyed", 32654, 382145.2, 3948811.75, 0.2618)


def flat_draft(*, door: DraftDoor | None = None, origin: DraftOrigin | None = ORIGIN) -> Draft:
    """Rooms of 3 x 4 m and 2 x 4 m (axes) with a door between, a window, a way out, a toilet and a mirror."""

    def wall(name: str, start: tuple[float, float], end: tuple[float, float], *openings: DraftOpening) -> DraftWall:
        return DraftWall(name, start, end, THICK_M, 2.6, openings)

    leaf = DraftOpening("d", "door", (1.0, 1.9), (0.0, 2.1), door or DraftDoor("leaf"))
    pane = DraftOpening("w", "window", (0.8, 2.0), (0.9, 2.0), DraftPane("pane"))
    way = DraftOpening("p", "passage", (0.5, 1.5), (0.0, 2.2))
    h = THICK_M / 2
    return Draft(
        "flat",
        (
            wall("south", (0, 0), (WIDE_M, 0)),
            wall("east", (WIDE_M, 0), (WIDE_M, DEEP_M), way),
            wall("north", (WIDE_M, DEEP_M), (0, DEEP_M), pane),
            wall("west", (0, DEEP_M), (0, 0)),
            wall("middle", (AT_M, 0), (AT_M, DEEP_M), leaf),
        ),
        (
            DraftFixture("toilet", "toilet", (h, 2.0, 0.0), (0.7, 0.38, 0.78), 0.0, "west"),
            DraftFixture("mirror", "mirror", (AT_M - h, 3.0, math.pi), (0.006, 0.6, 0.8), 0.1, "middle"),
        ),
        (
            DraftRoom("bath", "restroom", ((h, h), (AT_M - h, h), (AT_M - h, DEEP_M - h), (h, DEEP_M - h))),
            DraftRoom(
                "hall", "corridor", ((AT_M + h, h), (WIDE_M - h, h), (WIDE_M - h, DEEP_M - h), (AT_M + h, DEEP_M - h))
            ),
        ),
        level="L1",
        elevation_m=3.2,
        scan_plane_m=0.3,
        origin=origin,
    )


def map_of(draft: Draft, source: str = "flat.wkmap.urdf") -> SemanticMap:
    """The map that a draft becomes."""
    return read_map(parse(write_draft(draft), source))


def flat(*, door: DraftDoor | None = None, origin: DraftOrigin | None = ORIGIN) -> SemanticMap:
    """The flat as a map."""
    return map_of(flat_draft(door=door, origin=origin))
