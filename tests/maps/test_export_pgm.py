"""The raster of a map: surfaces in the right cells, doors as asked, and back again within one cell."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from tests.maps.flat import AT_M, DEEP_M, THICK_M, WIDE_M, flat
from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.exporters import ExportOptions, export_map
from wallkit.maps.geometry import parts, slice_parts
from wallkit.maps.grids.raster import read_raster
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.maps.read import load_map, read_map
from wallkit.maps.surfaces import floor_at, surfaces_at
from wallkit.maps.xml import parse

HALF_M = THICK_M / 2


def written(drawn, folder, **options):
    """The grid as map_server's readers see it, and what was found odd."""
    exported = export_map(drawn, folder / "floor.yaml", ExportOptions(**options))
    for path, data in exported.files.items():
        path.write_bytes(data)
    return read_raster(folder / "floor.yaml")


def at(grid, x, y):
    column, row = np.floor((np.array([x, y]) - grid.origin[:2]) / grid.resolution_m).astype(int)
    return int(grid.cells[row, column])


def centres(grid, value):
    rows, columns = np.nonzero(grid.cells == value)
    return np.column_stack([columns + 0.5, rows + 0.5]) * grid.resolution_m + grid.origin[:2]


@pytest.mark.parametrize("cell_m", [0.02, 0.05, 0.1])
def test_free_occupied_and_unknown_are_where_they_should_be(tmp_path, cell_m):
    grid, findings = written(flat(), tmp_path, cell_m=cell_m)
    assert findings == []
    assert grid.resolution_m == cell_m
    cut = slice_parts(parts(flat()), 0.3)
    solid = shapely.points(centres(grid, 100))
    # cells lie on what they stand for; only what is thinner than a cell is drawn by touch
    assert shapely.distance(solid, cut.solid).max() <= cell_m * np.sqrt(0.5) + 1e-3
    assert (shapely.distance(solid, cut.solid) <= 1e-3).mean() > 0.9
    free = shapely.points(centres(grid, 0))
    assert not shapely.intersects(free, cut.solid.buffer(-1e-6)).any()
    assert shapely.intersects(free, shapely.box(0, 0, WIDE_M, DEEP_M)).mean() > 0.99
    # free space is the rooms, to a border of one cell
    rooms = shapely.box(HALF_M, HALF_M, WIDE_M - HALF_M, DEEP_M - HALF_M).area
    assert len(free) * cell_m**2 == pytest.approx(rooms, abs=2 * cell_m * 4 * (WIDE_M + DEEP_M))
    assert grid.cells[0, 0] == -1


def test_every_visible_surface_has_an_occupied_cell_on_it(tmp_path):
    drawn = flat()
    grid, _ = written(drawn, tmp_path)
    seen = surfaces_at(drawn, floor_at(drawn, 0.3))
    middle = (seen.segments[:, :2] + seen.segments[:, 2:]) / 2
    opaque = np.array([name != "door" for name in seen.classes])
    away = shapely.distance(shapely.points(middle[opaque]), shapely.MultiPoint(centres(grid, 100)))
    assert away.max() <= 0.05


def test_the_inside_of_walls_is_unknown_unless_solid(tmp_path):
    inside = (WIDE_M / 2, 0.0)
    assert at(written(flat(), tmp_path, cell_m=0.02)[0], *inside) == -1
    assert at(written(flat(), tmp_path, cell_m=0.02, is_solid=True)[0], *inside) == 100


def test_doors_stand_as_asked(tmp_path):
    # the leaf hangs at (AT, 1.0 + clearance), flush with the wall's left face, and opens to it: towards -x
    closed, swung = (AT_M - HALF_M + 0.02, 1.5), (AT_M - HALF_M - 0.5, 1.03)
    for doors, wanted in (("closed", (100, 0)), ("open", (0, 100)), ("rest", (100, 0))):
        grid, _ = written(flat(), tmp_path, doors=doors)
        assert (at(grid, *closed), at(grid, *swung)) == wanted, doors
    grid, findings = written(flat(), tmp_path, doors="prior")
    assert findings == []
    # raw pixels keep the belief in per cent: closed 0.7, open 0.2
    assert (at(grid, *closed), at(grid, *swung)) == (70, 20)
    assert at(grid, 1.0, 3.0) == 0
    assert grid.cells[0, 0] == -1
    assert (grid.cells == 100).sum() > 100


def test_height_decides_what_is_there(tmp_path):
    toilet = (HALF_M + 0.68, 2.0)
    assert at(written(flat(), tmp_path, z_m=0.3)[0], *toilet) == 100
    assert at(written(flat(), tmp_path, z_m=1.0)[0], *toilet) == 0


def test_too_many_cells_are_refused_with_a_size_that_fits(tmp_path):
    with pytest.raises(MapError, match="more than 36,000,000") as caught:
        written(flat(), tmp_path, cell_m=0.0005)
    assert "--resolution 0.0" in caught.value.hint


@pytest.mark.parametrize("cell_m", [0.03, 0.05])
def test_export_then_import_is_the_same_map_within_one_cell(tmp_path, cell_m):
    drawn = flat()
    written(drawn, tmp_path, cell_m=cell_m, is_solid=False)
    (draft,) = import_map(tmp_path / "floor.yaml", ImportOptions(scan_plane_m=0.3)).drafts
    again = read_map(parse(write_draft(draft), "again.wkmap.urdf"))
    before = surfaces_at(drawn, floor_at(drawn, 0.3)).segments
    solid = slice_parts(parts(again), 0.3).solid
    points = shapely.points(np.vstack([before[:, :2], (before[:, :2] + before[:, 2:]) / 2]))
    # the leaf at its open state is no part of the closed raster
    points = points[~shapely.intersects(points, shapely.box(AT_M - 1.1, 0.95, AT_M - HALF_M - 1e-3, 1.1))]
    assert shapely.distance(points, solid).max() <= cell_m
    # and nothing is there that was not
    outline = shapely.points(shapely.get_coordinates(shapely.segmentize(solid.boundary, cell_m)))
    was = slice_parts(parts(drawn), 0.3).solid
    assert shapely.distance(outline, was).max() <= cell_m


@pytest.mark.data
def test_restroom_there_and_back(data, tmp_path):
    drawn = load_map(data / "maps/wkmap_example/restroom.wkmap.urdf")
    grid, findings = written(drawn, tmp_path)
    assert findings == []
    (draft,) = import_map(tmp_path / "floor.yaml", ImportOptions(scan_plane_m=0.3)).drafts
    solid = slice_parts(parts(read_map(parse(write_draft(draft), "again.wkmap.urdf"))), 0.3).solid
    was = slice_parts(parts(drawn), 0.3).solid
    outline = shapely.points(shapely.get_coordinates(shapely.segmentize(solid.boundary, 0.05)))
    assert shapely.distance(outline, was).max() <= 0.05
    # closed door: 19.2 m2 and 10.1 m2 apart (the data's own figures), here to a border of one cell
    import cv2

    count, labels = cv2.connectedComponents((grid.cells == 0).astype(np.uint8), connectivity=4)
    areas = sorted(np.bincount(labels.ravel())[1:] * 0.05**2)[-2:]
    assert count >= 3
    assert areas == pytest.approx([10.1, 19.2], abs=1.0)
