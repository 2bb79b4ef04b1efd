"""Rasters as walls: straight bands come back as the walls they were drawn from, clutter is kept, nothing vanishes."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from wallkit.core.geometry import invert, transform_points
from wallkit.errors import MapError
from wallkit.maps.draft.write import placed_walls, write_draft
from wallkit.maps.importers import recognise
from wallkit.maps.importers.imported import ImportOptions
from wallkit.maps.importers.raster import read_map_raster
from wallkit.maps.importers.skeleton import middle_lines

RESOLUTION = 0.05


def raster(tmp_path, occupied, *, origin=(0.0, 0.0, 0.0)):
    """A YAML and image of a grid (H, W), row 0 at the bottom; what is not occupied is free."""
    cv2.imwrite(str(tmp_path / "map.png"), np.where(occupied, 0, 254).astype(np.uint8)[::-1])
    path = tmp_path / "plan.yaml"
    path.write_text(
        f"image: map.png\nresolution: {RESOLUTION}\norigin: {list(origin)}\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def drawn(shape, *rectangles):
    occupied = np.zeros(shape, bool)
    for left, bottom, right, top in rectangles:
        occupied[bottom:top, left:right] = True
    return occupied


def note(imported, word):
    return next(n for n in imported.notes if word in n.message)


def covered(draft, points):
    """Which points (K, 2) lie in a box of the draft."""
    inside = np.zeros(len(points), bool)
    boxes = [(w.pose, w.length_m / 2, w.length_m, w.wall.thickness_m) for w in placed_walls(draft)]
    boxes += [(f.pose, 0.0, *f.size_m[:2]) for f in draft.fixtures]
    for pose, ahead, deep, wide in boxes:
        x, y = transform_points(invert(pose), points).T
        inside |= (np.abs(x - ahead) <= deep / 2 + 1e-6) & (np.abs(y) <= wide / 2 + 1e-6)
    return inside


@pytest.mark.parametrize("thick", [1, 2, 3, 4])
@pytest.mark.parametrize("origin", [(0.0, 0.0, 0.0), (-3.0, 2.0, 0.4)])
def test_a_straight_band_is_one_wall_in_its_middle_as_thick_as_its_cells(tmp_path, thick, origin):
    path = raster(tmp_path, drawn((30, 60), (10, 10, 50, 10 + thick)), origin=origin)
    (draft,) = read_map_raster(path, ImportOptions()).drafts
    (wall,) = draft.walls
    ends = transform_points(origin, RESOLUTION * np.array([[10, 10 + thick / 2], [50, 10 + thick / 2]]))
    found = np.array(sorted([wall.start, wall.end]))
    np.testing.assert_allclose(found, ends[np.lexsort(ends.T[::-1])], atol=RESOLUTION / 4)
    assert wall.thickness_m == pytest.approx(thick * RESOLUTION, rel=0.1)


def test_a_turned_wall_is_one_wall_not_a_staircase(tmp_path):
    rows, columns = np.indices((120, 120))
    angle = math.radians(20)
    across = (rows - 60) * math.cos(angle) - (columns - 60) * math.sin(angle)
    along = (rows - 60) * math.sin(angle) + (columns - 60) * math.cos(angle)
    path = raster(tmp_path, (np.abs(across) < 1.5) & (np.abs(along) < 45))
    (draft,) = read_map_raster(path, ImportOptions()).drafts
    longest = max(draft.walls, key=lambda w: w.length_m)
    assert len(draft.walls) <= 3
    assert longest.length_m > 80 * RESOLUTION
    heading = math.atan2(longest.end[1] - longest.start[1], longest.end[0] - longest.start[0]) % math.pi
    assert heading == pytest.approx(angle, abs=math.radians(1.5))


def test_a_room_is_closed_and_explained_to_half_a_cell(tmp_path):
    room = drawn((80, 100), (10, 10, 90, 12), (10, 68, 90, 70), (10, 10, 12, 70), (88, 10, 90, 70))
    imported = read_map_raster(raster(tmp_path, room), ImportOptions())
    (draft,) = imported.drafts
    residual = note(imported, "residual").detail
    assert residual["cells_m"] < RESOLUTION / 4
    assert residual["outline_m"] < RESOLUTION / 4
    # no way out: a flood from inside meets only walls
    fine = np.stack(np.meshgrid(np.arange(0, 5, 0.025), np.arange(0, 4, 0.025)), axis=-1).reshape(-1, 2) + 0.0125
    free = ~covered(draft, fine).reshape(160, 200)
    _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    assert labels[80, 100] != labels[2, 2]


def test_specks_and_blobs_become_unknown_pieces_and_nothing_vanishes(tmp_path):
    rng = np.random.default_rng(2)
    clutter = rng.random((100, 100)) < 0.08
    clutter[40:60, 40:60] = True
    path = raster(tmp_path, clutter)
    imported = read_map_raster(path, ImportOptions())
    (draft,) = imported.drafts
    assert {f.class_name for f in draft.fixtures} == {"unknown"}
    rows, columns = np.nonzero(clutter)
    solid = cv2.erode(clutter.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    seen = ~solid[rows, columns]
    centres = (np.column_stack([columns, rows])[seen] + 0.5) * RESOLUTION
    # every cell on an outline is in a box, or within EXPLAINED_CELLS of one
    reach = np.array([[dx, dy] for dx in (-0.75, 0, 0.75) for dy in (-0.75, 0, 0.75)]) * RESOLUTION
    assert np.all(np.any([covered(draft, centres + d) for d in reach], axis=0))
    assert 0 < note(imported, "class unknown").detail["share"] < 1
    write_draft(draft)


def test_loops_and_crossings_are_traced_once():
    ring = np.zeros((40, 40), bool)
    ring[5:30, 5:30] = True
    ring[7:28, 7:28] = False
    ((loop),) = middle_lines(ring, 0.75)
    assert np.array_equal(loop[0], loop[-1])
    length = np.hypot(*np.diff(loop, axis=0).T).sum()
    assert length == pytest.approx(4 * 23, abs=4)
    cross = np.zeros((41, 41), bool)
    cross[20, 5:36] = cross[5:36, 20] = True
    arms = middle_lines(cross, 0.75)
    assert len(arms) == 4
    assert sum(np.hypot(*np.diff(arm, axis=0).T).sum() for arm in arms) == pytest.approx(62, abs=0.5)


def test_the_users_tolerance_trades_walls_for_distance(tmp_path):
    columns = np.arange(10, 190)
    waves = np.zeros((80, 200), bool)
    waves[(40 + 6 * np.sin(columns / 8)).astype(int), columns] = True
    path = raster(tmp_path, waves)
    fine, coarse = (read_map_raster(path, ImportOptions(tolerance_m=t * RESOLUTION)) for t in (0.5, 4.0))
    assert len(fine.drafts[0].walls) > 2 * len(coarse.drafts[0].walls)


def test_a_map_without_walls_is_refused(tmp_path):
    with pytest.raises(MapError, match="no occupied cell"):
        read_map_raster(raster(tmp_path, np.zeros((5, 5), bool)), ImportOptions())


@pytest.mark.data
def test_intels_raster_is_explained_to_a_quarter_of_a_cell_in_both_directions(data):
    path = data / "logs/carmen/intel.map.yaml"
    assert recognise(path) == "pgm"
    imported = read_map_raster(path, ImportOptions())
    (draft,) = imported.drafts
    residual = note(imported, "residual").detail
    assert residual["cells_m"] < 0.0125
    assert residual["outline_m"] < 0.0125
    assert len(draft.walls) + len(draft.fixtures) < 3000
    assert note(imported, "class unknown").detail["share"] < 0.1


@pytest.mark.data
def test_the_rasters_own_oddities_are_passed_on(data):
    imported = read_map_raster(data / "maps/pgm/depot.yaml", ImportOptions())
    assert "WK-R002" in {n.code for n in imported.notes}


def test_two_pixels_with_one_middle_end_a_line():
    # an end was once followed in no direction, for ever
    band = np.array([[0, 1, 1, 1], [0, 0, 0, 0], [1, 0, 0, 1], [0, 1, 0, 1]], dtype=bool)
    lines = middle_lines(band, 0.75)
    assert all(line.min() >= 0 and line.max() <= 4 for line in lines)
    assert max(float(np.hypot(*(line[-1] - line[0]))) for line in lines) > 1.0
