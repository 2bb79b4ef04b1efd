"""Draws the maps of the evaluation set that are not among maps/: hall, twins and lab. `python evaluation/draw.py`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

from wallkit.maps.classes import ClassInfo
from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftPane, DraftRoom, DraftWall
from wallkit.maps.draft.write import write_draft

HERE = Path(__file__).parent
FITTING = ClassInfo("fitting", p_return=1.0, color="#e8e0d0")
# a rule that a map breaks on purpose
IGNORED = {"twins": ("WK-L003", "that two places look alike is what this map is for")}
THICK_M, HIGH_M, PLANE_M = 0.2, 2.7, 0.3
H = THICK_M / 2


def main() -> None:
    for draft in (hall(), twins(), lab()):
        text = write_draft(draft).decode()
        if draft.name in IGNORED:
            rule, reason = IGNORED[draft.name]
            text = text.replace("  </wk:map>", f'    <wk:ignore rule="{rule}" reason="{reason}"/>\n  </wk:map>')
        (HERE / "maps" / f"{draft.name}.wkmap.urdf").write_text(text, encoding="utf-8")


def hall() -> Draft:
    """28 x 18 m under one roof, wider than the LiDAR sees; six columns, a stage, a bar, a glazed front."""
    door = DraftDoor("door_main", "double_hinged", "start", "left", connects=("outside", "hall"))
    side = DraftDoor("door_side", "hinged", "start", "left", connects=("outside", "hall"))
    panes = [pane_in(f"front_{k}", x, 2.6, 0.05, 2.2) for k, x in enumerate((1.5, 5.5, 17.5, 22.5))]
    walls = (
        wall("south", (0, 0), (28, 0), door_in("main", 12.6, 1.8, door), *panes, high=4.5),
        wall("east", (28, 0), (28, 18), door_in("side", 13.0, 1.0, side), high=4.5),
        wall("north", (28, 18), (0, 18), high=4.5),
        wall("west", (0, 18), (0, 0), high=4.5),
    )
    columns = [DraftFixture(f"column_{k}", "column", (x, y, 0.0), (0.5, 0.5, 4.5)) for k, (x, y) in enumerate(
        ((7, 6), (14, 6), (21, 6), (7, 12), (14, 12), (21, 12.8)))]  # fmt: skip
    fixtures = (
        *columns,
        DraftFixture("stage", "fitting", (5.0, 17.9 - 1.5, -math.pi / 2), (3.0, 7.0, 0.6)),
        DraftFixture("bar", "fitting", (26.6, 5.2, math.pi), (0.7, 4.2, 1.1)),
        DraftFixture("cloakroom", "fitting", (0.1, 7.0, 0.0), (0.6, 3.0, 1.9), wall="west"),
        DraftFixture("radiator_e", "radiator", (27.9, 9.0, math.pi), (0.12, 2.0, 0.6), 0.1, "east"),
        DraftFixture("bin_1", "trash", (17.0, 0.5, 0.0), (0.4, 0.4, 0.8)),
        DraftFixture("bin_2", "trash", (11.0, 17.4, 0.0), (0.4, 0.4, 0.8)),
    )
    return Draft(
        "hall", walls, fixtures, (room("hall", "hall", 0, 0, 28, 18),), classes=(FITTING,), scan_plane_m=PLANE_M
    )


def twins() -> Draft:
    """A corridor of 32 m with five rooms on each side, the same when turned by half a turn but for a cabinet at one end."""
    low, high, top = 5.0, 7.2, 12.2
    edges = [0.0, 6.4, 12.8, 19.2, 25.6, 32.0]
    below = [door_in(f"a{k}", x + 1.2, 0.9, leaf(f"a{k}", "right")) for k, x in enumerate(edges[:-1])]
    above = [door_in(f"b{k}", x + 1.2, 0.9, leaf(f"b{k}", "right")) for k, x in enumerate(edges[:-1])]
    walls = [
        wall("south", (0, 0), (32, 0)),
        wall("east", (32, 0), (32, top)),
        wall("north", (32, top), (0, top)),
        wall("west", (0, top), (0, 0)),
        wall("row_a", (0, low), (32, low), *below),
        # drawn the other way, so that each half is the other one turned
        wall("row_b", (32, high), (0, high), *above),
    ]
    fixtures, rooms = [], [room("corridor", "circulation", 0, low, 32, high)]
    for k, x in enumerate(edges[:-1]):
        if k:
            walls += [wall(f"part_a{k}", (x, 0), (x, low)), wall(f"part_b{k}", (32 - x, high), (32 - x, top))]
        rooms += [room(f"a{k}", "office", x, 0, x + 6.4, low), room(f"b{k}", "office", 32 - x - 6.4, high, 32 - x, top)]
        fixtures += [
            DraftFixture(f"cupboard_a{k}", "fitting", (x + 4.6, H, math.pi / 2), (0.45, 1.6, 1.9), wall="south"),
            DraftFixture(
                f"cupboard_b{k}", "fitting", (32 - x - 4.6, top - H, -math.pi / 2), (0.45, 1.6, 1.9), wall="north"
            ),
            DraftFixture(f"table_a{k}", "furniture", (x + 1.9, 1.7, 0.0), (0.8, 1.6, 0.75)),
            DraftFixture(f"table_b{k}", "furniture", (32 - x - 1.9, top - 1.7, 0.0), (0.8, 1.6, 0.75)),
        ]
    fixtures.append(DraftFixture("cabinet", "fitting", (32 - H, 6.1, math.pi), (0.4, 1.0, 1.6), wall="east"))
    return Draft("twins", tuple(walls), tuple(fixtures), tuple(rooms), classes=(FITTING,), scan_plane_m=PLANE_M)


def lab() -> Draft:
    """16 x 11 m full of benches, racks and stools, with a glazed office in one corner."""
    exit_ = DraftDoor("door_exit", "hinged", "end", "left", connects=("outside", "lab"))
    office = DraftDoor("door_office", "hinged", "start", "right", connects=("lab", "office"))
    walls = (
        wall("south", (0, 0), (16, 0), door_in("exit", 1.2, 1.0, exit_)),
        wall("east", (16, 0), (16, 11)),
        wall("north", (16, 11), (0, 11), pane_in("win_a", 2, 2.0, 0.95, 2.2), pane_in("win_b", 9, 2.0, 0.95, 2.2)),
        wall("west", (0, 11), (0, 0)),
        wall(
            "office_s", (11.5, 7.2), (16, 7.2), door_in("office", 0.5, 0.9, office), pane_in("g1", 1.8, 2.2, 0.05, 2.1)
        ),
        wall("office_w", (11.5, 11), (11.5, 7.2)),
    )
    fixtures = [
        *(DraftFixture(f"bench_{k}", "fitting", (x, y, 0.0), (2.6, 0.9, 0.9)) for k, (x, y) in enumerate(
            ((3.6, 3.4), (7.6, 3.4), (3.6, 6.2), (7.6, 6.2), (11.6, 3.4)))),
        *(DraftFixture(f"stool_{k}", "furniture", (x, y, turn), (0.36, 0.36, 0.6)) for k, (x, y, turn) in enumerate(
            ((3.0, 4.3, 0.3), (4.3, 2.5, 0.9), (7.0, 7.1, 0.1), (8.2, 4.4, 0.6), (11.2, 2.4, 1.2), (3.2, 7.2, 0.5)))),
        *(DraftFixture(f"rack_{k}", "fitting", (x, 11 - H, -math.pi / 2), (0.6, 1.2, 2.0), wall="north")
          for k, x in enumerate((1.2, 2.6, 5.0))),
        DraftFixture("fume_hood", "fitting", (16 - H, 2.2, math.pi), (0.9, 1.8, 2.3), wall="east"),
        DraftFixture("sink_1", "sink", (H, 7.6, 0.0), (0.55, 0.7, 0.25), 0.65, "west"),
        DraftFixture("fridge", "fitting", (H, 9.2, 0.0), (0.7, 0.7, 1.8), wall="west"),
        DraftFixture("column_1", "column", (9.8, 8.2, 0.0), (0.4, 0.4, HIGH_M)),
        DraftFixture("desk", "furniture", (14.8, 9.6, math.pi), (0.8, 1.6, 0.75)),
        DraftFixture("shelf", "fitting", (13.4, 11 - H, -math.pi / 2), (0.4, 1.8, 2.0), wall="north"),
        DraftFixture("bin", "trash", (15.4, 5.9, 0.0), (0.35, 0.35, 0.7)),
    ]  # fmt: skip
    inner = ((H, H), (16 - H, H), (16 - H, 7.2 - H), (11.5 - H, 7.2 - H), (11.5 - H, 11 - H), (H, 11 - H))
    rooms = (DraftRoom("lab", "laboratory", inner), room("office", "office", 11.5, 7.2, 16, 11))
    return Draft("lab", walls, tuple(fixtures), rooms, classes=(FITTING,), scan_plane_m=PLANE_M)


# -------------------------------------------------------------------------------------------- parts


def wall(
    name: str, start: tuple[float, float], end: tuple[float, float], *openings: DraftOpening, high: float = HIGH_M
) -> DraftWall:
    return DraftWall(name, start, end, THICK_M, high, tuple(openings))


def door_in(name: str, at: float, wide: float, door: DraftDoor) -> DraftOpening:
    return DraftOpening(f"d_{name}", "door", (at, at + wide), (0.0, 2.1), door)


def pane_in(name: str, at: float, wide: float, low: float, high: float) -> DraftOpening:
    return DraftOpening(f"w_{name}", "window", (at, at + wide), (low, high), DraftPane(f"pane_{name}", "glass"))


def leaf(name: str, side: Literal["left", "right"]) -> DraftDoor:
    return DraftDoor(f"door_{name}", "hinged", "start", side, connects=("corridor", name))


def room(name: str, kind: str, x0: float, y0: float, x1: float, y1: float) -> DraftRoom:
    return DraftRoom(name, kind, ((x0 + H, y0 + H), (x1 - H, y0 + H), (x1 - H, y1 - H), (x0 + H, y1 - H)))


if __name__ == "__main__":
    main()
