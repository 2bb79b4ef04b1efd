"""Single faults that leave a map sound but worse to localize in, each with the rule that must notice it.

Kept apart from `faults`: asking whether a robot can tell where it is takes a second or two a map.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftOpening, DraftRoom, DraftWall
from wallkit.maps.draft.write import write_draft

THICK_M = 0.12


def hall(
    rng: np.random.Generator,
    *,
    size: tuple[float, float] | None = None,
    scan_plane_m: float = 0.3,
    wall_class: str = "wall",
    wall_thickness_m: float = THICK_M,
    desk_height_m: float = 0.75,
    has_columns: bool = True,
    extra: tuple[DraftFixture, ...] = (),
    openings: tuple[DraftOpening, ...] = (),
    has_partition: bool = True,
) -> bytes:
    """A hall whose columns, desk and cross wall make every place in it look different."""
    wide, deep = size or (float(rng.uniform(7, 9)), float(rng.uniform(4.5, 6)))
    t = wall_thickness_m
    door = DraftOpening(
        "d", "door", (0.8, 1.7), (0.0, 2.1), DraftDoor("door", side="left", connects=("hall", "outside"))
    )
    walls = [
        DraftWall("south", (0, 0), (wide, 0), t, openings=(door, *openings)),
        DraftWall("north", (0, deep), (wide, deep), t, class_name=wall_class),
        DraftWall("west", (0, 0), (0, deep), t, class_name=wall_class),
        DraftWall("east", (wide, 0), (wide, deep), t, class_name=wall_class),
    ]
    if has_partition:
        walls.append(DraftWall("cross", (0.62 * wide, 0.45 * deep), (0.62 * wide, deep), THICK_M))
    fixtures = list(extra)
    if has_columns:
        fixtures.append(DraftFixture("column_a", "column", (0.3 * wide, 0.6 * deep, 0.4), (0.5, 0.7, 2.5)))
        fixtures.append(DraftFixture("column_b", "column", (0.85 * wide, 0.3 * deep, 0.9), (0.4, 0.4, 2.5)))
        fixtures.append(DraftFixture("desk", "furniture", (0.45 * wide, 0.25 * deep, 0.2), (0.6, 1.0, desk_height_m)))
    h = t / 2
    room = DraftRoom("hall", "office", ((h, h), (wide - h, h), (wide - h, deep - h), (h, deep - h)))
    return write_draft(Draft("hall", tuple(walls), tuple(fixtures), (room,), scan_plane_m=scan_plane_m))


def _with(data: bytes, before: str, after: str) -> bytes:
    text = data.decode()
    assert before in text
    return text.replace(before, after, 1).encode()


def _place_in_wall(rng: np.random.Generator) -> bytes:
    x = float(rng.uniform(0.5, 3.5))
    joint = f'<parent link="west"/><child link="start_1"/><origin xyz="{x:.3f} 0 0"/>'
    link = f'<link name="start_1"/><joint name="at_start" type="fixed">{joint}</joint>'
    return _with(hall(rng), "</robot>", f"{link}</robot>")


def _short_sighted(rng: np.random.Generator) -> bytes:
    data = hall(rng, size=(14.0, 10.0), has_columns=False, has_partition=False)
    return _with(data, "  </wk:map>", '    <wk:check max-range="1.5"/>\n  </wk:map>')


def _corridor(rng: np.random.Generator) -> bytes:
    data = hall(rng, size=(float(rng.uniform(25, 35)), 2.4), has_columns=False, has_partition=False)
    return _with(data, "  </wk:map>", '    <wk:check max-range="5"/>\n  </wk:map>')


def _phantom_room(rng: np.random.Generator) -> bytes:
    data = hall(rng).decode()
    x = float(rng.uniform(0.8, 1.2))
    mirror = (
        '<link name="mirror"><wk:object class="mirror"/><collision><origin xyz="0.003 0 0.8"/><geometry>'
        '<box size="0.006 1.2 1.4"/></geometry></collision></link><joint name="at_mirror" type="fixed">'
        f'<parent link="cross"/><child link="mirror"/><origin xyz="{x:.3f} 0.06 0" rpy="0 0 1.5707963"/></joint>'
    )
    return data.replace("</robot>", f"{mirror}</robot>").encode()


def _movable(rng: np.random.Generator) -> bytes:
    desks = tuple(
        DraftFixture(f"cupboard_{k}", "furniture", (1.2 + 1.5 * k, 4.0, 0.0), (0.6, 1.4, 1.8)) for k in range(4)
    )
    return hall(rng, size=(9.0, 5.5), has_columns=False, extra=desks)


def _narrow_way(rng: np.random.Generator) -> bytes:
    x, gap = float(rng.uniform(2.5, 5.0)), float(rng.uniform(0.05, 0.09))
    return hall(rng, openings=(DraftOpening("slit", "passage", (x, x + gap), (0.0, 2.5)),))


# name of the fault -> (rule, the broken map)
FAULTS_OF_USE: dict[str, tuple[str, Callable[[np.random.Generator], bytes]]] = {
    "plane above everything": ("WK-L002", lambda rng: hall(rng, scan_plane_m=float(rng.uniform(2.6, 6)))),
    "nothing but four walls": ("WK-L003", lambda rng: hall(rng, has_columns=False, has_partition=False)),
    "corridor longer than the range": ("WK-L004", _corridor),
    "walls of glass": ("WK-L006", lambda rng: hall(rng, wall_class="glass")),
    "mirror before free floor": ("WK-L007", _phantom_room),
    "range shorter than the hall": ("WK-L008", _short_sighted),
    "much furniture": ("WK-L009", _movable),
    "start in a wall": ("WK-L010", _place_in_wall),
    "walls thinner than a cell": ("WK-L011", lambda rng: hall(rng, wall_thickness_m=float(rng.uniform(0.02, 0.045)))),
    "slit": ("WK-L012", _narrow_way),
    "desk ends at the plane": ("WK-L013", lambda rng: hall(rng, desk_height_m=float(rng.uniform(0.305, 0.34)))),
}
