"""Line lists: every line a thin wall where it was marked."""

from __future__ import annotations

import numpy as np
import pytest

from wallkit.errors import MapError
from wallkit.maps.draft.write import write_draft
from wallkit.maps.grids.fields import OCCUPIED_FROM, distance_to
from wallkit.maps.grids.raster import read_raster
from wallkit.maps.importers import import_map, recognise
from wallkit.maps.importers.imported import ImportOptions
from wallkit.maps.importers.lines import read_lines


def lines(tmp_path, *features):
    path = tmp_path / "lines.yaml"
    path.write_text("source_id: laser\nfeatures:\n" + "".join(f"  - {feature}\n" for feature in features))
    return path


def test_lines_become_thin_walls_in_place(tmp_path):
    path = lines(
        tmp_path, "{id: 7, source: [1.0, 2.0, 0.0], target: [1.0, 6.0, 0.0]}", "{source: [0, 0], target: [3, 0]}"
    )
    (draft,) = read_lines(path, ImportOptions(thickness_m=0.05)).drafts
    first, second = draft.walls
    assert (first.name, first.start, first.end, first.thickness_m) == ("line_7", (1.0, 2.0), (1.0, 6.0), 0.05)
    assert second.end == (3.0, 0.0)


def test_units_scale_and_points_are_skipped_with_a_note(tmp_path):
    path = lines(tmp_path, "{source: [0, 0], target: [3000, 0]}", "{source: [5, 5], target: [5, 5]}")
    imported = read_lines(path, ImportOptions(units="mm"))
    assert imported.drafts[0].walls[0].end == pytest.approx((3.0, 0.0))
    assert [note.line for note in imported.notes if note.code == "import.skipped"] == [4]


def test_lines_in_millimetres_are_noticed(tmp_path):
    imported = read_lines(lines(tmp_path, "{source: [0, 0], target: [12000, 0]}"), ImportOptions())
    assert [note.code for note in imported.notes if note.severity == "error"] == ["WK-E041"]


@pytest.mark.parametrize(
    ("feature", "line"),
    [
        ("{source: [0, 0]}", 3),
        ("{source: [0, 0], target: [1]}", 3),
        ("{source: [0, 0], target: [1, .nan]}", 3),
        ("7", 3),
    ],
)
def test_a_malformed_line_is_said_with_its_place(tmp_path, feature, line):
    path = lines(tmp_path, feature)
    with pytest.raises(MapError, match="has no points source and target") as caught:
        read_lines(path, ImportOptions())
    assert caught.value.where == f"{path}:{line}"


@pytest.mark.parametrize(
    "text", ["features: 7\n", "features: []\n", "a: [1\n", "- 1\n", "features: {{}\n", "!!int x\n"]
)
def test_what_is_no_line_list_is_refused(tmp_path, text):
    path = tmp_path / "lines.yaml"
    path.write_text(text)
    with pytest.raises(MapError) as caught:
        read_lines(path, ImportOptions())
    assert str(path) in caught.value.where


@pytest.mark.data
def test_the_apartments_lines_lie_on_its_raster(data):
    folder = data / "maps/vector_raster_pairs/ipa-apartment"
    assert recognise(folder / "lineMap_ipaApartment.yaml") == "lines"
    (draft,) = import_map(folder / "lineMap_ipaApartment.yaml", ImportOptions()).drafts
    grid, _ = read_raster(folder / "map.yaml")
    away = distance_to(grid.cells >= OCCUPIED_FROM, grid.resolution_m)
    found = []
    for wall in draft.walls:
        start, end = np.array(wall.start), np.array(wall.end)
        points = start + np.linspace(0, 1, int(wall.length_m / 0.05) + 2)[:, None] * (end - start)
        columns, rows = np.floor((points - grid.origin[:2]) / grid.resolution_m).astype(int).T
        found.append(away[rows, columns])
    assert len(draft.walls) == 60
    assert np.median(np.concatenate(found)) == 0.0
    assert np.mean(np.concatenate(found) <= 0.15) == pytest.approx(0.954, abs=0.01)
    # things that were moved before the raster was made: nothing of them within twice that
    assert sum(wall.min() > 0.301 for wall in found) == 5
    write_draft(draft)
