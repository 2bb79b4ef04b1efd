"""building.yaml from maps: the walls and doors that made them come back, and so does every motion of a door."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tests.maps.drawn import box, placed, robot, wall
from tests.maps.flat import AT_M, DEEP_M, WIDE_M, flat, flat_draft, map_of
from wallkit.errors import MapError
from wallkit.maps.draft.doors import DraftDoor
from wallkit.maps.exporters import ExportOptions, export_map
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.maps.read import read_map
from wallkit.maps.xml import parse


def there_and_back(drawn, folder):
    """The draft that a map's building.yaml is read as."""
    path = folder / "x.building.yaml"
    (data,) = export_map(drawn, path, ExportOptions()).files.values()
    path.write_bytes(data)
    (draft,) = import_map(path, ImportOptions()).drafts
    return draft


def axes(draft):
    """(N, 4) both ends of every wall without doors, the smaller one first, sorted."""
    ends = np.array([(wall.start, wall.end) for wall in draft.walls if not wall.openings])
    pairs = [sorted(pair) for pair in (np.round(ends, 3) + 0.0).tolist()]
    return np.array(sorted([*a, *b] for a, b in pairs))


def doors(draft):
    """{name: (start, end, door)} with the ends in the map."""
    found = {}
    for piece in draft.walls:
        along = np.subtract(piece.end, piece.start) / piece.length_m
        for opening in piece.openings:
            ends = [tuple(np.round(np.array(piece.start) + x * along, 3).tolist()) for x in opening.along]
            found[opening.fill.name] = (*ends, opening.fill)
    return found


def test_walls_meet_at_their_axes_and_the_door_is_a_gap(tmp_path):
    draft = there_and_back(flat(), tmp_path)
    w, d, m = WIDE_M, DEEP_M, AT_M
    wanted = [(0, 0, w, 0), (0, d, w, d), (0, 0, 0, d), (m, 0, m, 1.0), (m, 1.9, m, d), (w, 0, w, 0.5), (w, 1.5, w, d)]
    np.testing.assert_allclose(axes(draft), sorted(wanted), atol=1e-3)
    assert {wall.height_m for wall in draft.walls if not wall.openings} == {2.6}
    assert draft.level == "L1"
    assert draft.elevation_m == 3.2
    start, end, _ = doors(draft)["leaf"]
    assert (start, end) == ((m, 1.0), (m, 1.9))
    toilet = next(fixture for fixture in draft.fixtures if fixture.class_name == "toilet")
    # the importer stands a toilet with its back to the wall beside it: where it was
    assert toilet.pose == pytest.approx((0.05, 2.0, 0.0), abs=0.011)


@pytest.mark.parametrize("motion", ["hinged", "double_hinged", "sliding", "double_sliding"])
@pytest.mark.parametrize("hinge", ["start", "end"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_every_motion_of_a_door_comes_back(tmp_path, motion, hinge, side):
    door = DraftDoor("gate", motion, hinge, side, math.radians(80))
    (_, _, back) = doors(there_and_back(flat(door=door), tmp_path))["gate"]
    hinged = motion.endswith("hinged")
    assert back.motion == motion
    assert back.hinge == ("start" if motion.startswith("double") else hinge)
    assert back.side == side
    assert back.travel_rad == pytest.approx(math.radians(80 if hinged else 90), abs=1e-5)


def test_a_second_time_changes_nothing(tmp_path):
    once = there_and_back(flat(), tmp_path)
    again = there_and_back(map_of(once), tmp_path)
    np.testing.assert_allclose(axes(again), axes(once), atol=1e-3)
    assert {name: door[:2] for name, door in doors(again).items()} == {n: door[:2] for n, door in doors(once).items()}


def test_slanted_and_crossing_walls_come_back_at_their_points(tmp_path):
    """A star of three walls, a bend of 20 degrees, a T at 60 degrees: the drawn points, whatever the boxes did."""
    from wallkit.maps.draft.draft import Draft, DraftWall

    def at(angle_deg, length_m):
        return (length_m * math.cos(math.radians(angle_deg)), length_m * math.sin(math.radians(angle_deg)))

    ends = [at(0, 3.0), at(120, 2.0), at(250, 2.5)]
    drawn = [DraftWall(f"s{i}", (0.0, 0.0), end, 0.1) for i, end in enumerate(ends)]
    bend = (ends[0][0] + at(20, 2.0)[0], at(20, 2.0)[1])
    drawn += [
        DraftWall("bend", ends[0], bend, 0.1),
        DraftWall("tee", (1.5, 0.0), (1.5 + at(60, 1)[0], at(60, 1)[1]), 0.1),
    ]
    draft = Draft("star", tuple(drawn))
    np.testing.assert_allclose(axes(there_and_back(map_of(draft), tmp_path)), axes(draft), atol=2e-3)


def test_what_has_no_wall_has_no_scale():
    lone = read_map(parse(robot(box("bin", "0.3 0.3 0.5", wk_class="trash"), placed("bin", "1 1 0.25")), "lone.urdf"))
    with pytest.raises(MapError, match="no wall"):
        export_map(lone, Path("x.building.yaml"), ExportOptions())


def test_glass_walls_are_sheer_and_a_wall_that_is_all_door_is_none(tmp_path):
    path = tmp_path / "x.building.yaml"
    glazed = wall("pane", (0, 0), (4, 0), 0.02).replace('class="wall"', 'class="glass"')
    drawn = read_map(parse(robot(glazed, wall("solid", (0, 1), (4, 1))), "g.urdf"))
    (data,) = export_map(drawn, path, ExportOptions()).files.values()
    path.write_bytes(data)
    imported = import_map(path, ImportOptions())
    assert any("1 walls are drawn transparent" in note.message for note in imported.notes)
    full = DraftDoor("gate")
    draft = flat_draft(door=full)
    assert len(axes(there_and_back(map_of(draft), tmp_path))) == 7


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "walls", "length_m", "widths"),
    [
        ("office", 33, 92.6, [0.89, 0.89, 1.90]),
        (
            "hotel",
            254,
            829.17,
            [1.28, 1.28, 1.28, 1.28, 1.37, 1.37, 1.42, 1.42, 1.55, 1.55, 1.58, 1.58, 1.60, 2.24, 2.24],
        ),
    ],
)
def test_real_buildings_keep_their_walls_and_doors(data, tmp_path, name, walls, length_m, widths):
    drafts = import_map(data / f"maps/rmf/{name}.building.yaml", ImportOptions()).drafts
    back = [there_and_back(map_of(draft), tmp_path) for draft in drafts]
    pieces = [wall for draft in back for wall in draft.walls if not wall.openings]
    assert len(pieces) == walls
    assert sum(wall.length_m for wall in pieces) == pytest.approx(length_m, abs=0.1)
    for before, after in zip(drafts, back, strict=True):
        wide = [sorted(math.dist(*door[:2]) for door in doors(draft).values()) for draft in (before, after)]
        assert wide[1] == pytest.approx(wide[0], abs=0.01)
        motions = [{n: (d.motion, d.hinge, d.side) for n, (*_, d) in doors(draft).items()} for draft in (before, after)]
        # a double door's hinge is both ends: the file says start
        assert {
            n: m if not m[0].startswith("double") else (m[0], "start", m[2]) for n, m in motions[0].items()
        } == motions[1]
    found = sorted(math.dist(*door[:2]) for draft in back for door in doors(draft).values())
    assert found[: len(widths)] == pytest.approx(widths, abs=0.01)
