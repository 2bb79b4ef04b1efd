"""`wallkit localize` on semantic maps: as good as the raster they were made from, better than a raster of a known world."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from tests.plan import Plan, occupancy
from tests.recorded import record
from wallkit.maps.draft.draft import Draft, DraftFixture, DraftWall
from wallkit.maps.draft.write import write_draft
from wallkit.maps.geometry import slice_at
from wallkit.maps.importers import ImportOptions, import_map
from wallkit.maps.read import load_map
from wallkit.pipelines.config import load_config
from wallkit.pipelines.evaluate import evaluate_steps
from wallkit.pipelines.localize import Request, localize, prepare

# an L of two rooms, turned and off every grid, with two cupboards and a column
TURN, SHIFT = 0.21, np.array([3.137, -1.713])
WALLS = [(0, 0, 8, 0), (8, 0, 8, 5), (8, 5, 5, 5), (5, 5, 5, 9), (5, 9, 0, 9), (0, 9, 0, 0), (0, 4, 2.5, 4)]
STANDING = [
    ("cupboard_a", 6.8, 4.5, 0.0, 1.2, 0.6),
    ("cupboard_b", 0.5, 8.1, 0.0, 0.6, 0.9),
    ("column", 3.4, 3, 0.4, 0.4, 0.4),
]
ROUTE = [(1, 1.2), (6.5, 1.4), (6.4, 3.2), (4.2, 4.2), (3.9, 7.8), (1.6, 7.6), (1.5, 5.2)]


def moved(x, y):
    c, s = np.cos(TURN), np.sin(TURN)
    return float(c * x - s * y + SHIFT[0]), float(s * x + c * y + SHIFT[1])


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    """Three logs of a robot in a known building, its semantic map, and a raster of it with 5 cm cells."""
    folder = tmp_path_factory.mktemp("world")
    walls = tuple(DraftWall(f"wall_{n}", moved(*w[:2]), moved(*w[2:]), 0.1) for n, w in enumerate(WALLS))
    fixtures = tuple(
        DraftFixture(name, "furniture", (*moved(x, y), TURN + yaw), (deep, wide, 1.8))
        for name, x, y, yaw, deep, wide in STANDING
    )
    path = folder / "known.wkmap.urdf"
    path.write_bytes(write_draft(Draft("known", walls, fixtures, scan_plane_m=0.3)))
    write_raster(folder, Plan(slice_at(load_map(path), 0.3).segments))
    for seed in range(3):
        record(path, [moved(*point) for point in ROUTE], folder / f"drive{seed}", seed)
    return folder


def write_raster(folder, plan):
    grid = occupancy(plan, 0.05, inside=np.array(moved(1, 1)))
    shades = np.where(grid.cells < 0, 205, np.where(grid.cells > 50, 0, 254)).astype(np.uint8)
    cv2.imwrite(str(folder / "known.pgm"), shades[::-1])
    x, y, _ = grid.origin
    (folder / "known.yaml").write_text(
        f"image: known.pgm\nresolution: 0.05\norigin: [{x}, {y}, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def errors_m(world, chart, *words):
    """Root mean square position error over every log, from the true start."""
    config = load_config(None, words).config
    found = []
    for log in sorted(world.glob("drive*/log.mcap")):
        run = localize(prepare(Request((log,), world / chart, init="truth"), config))
        found.append(evaluate_steps(run.steps, run.prepared.truth, config.evaluate).metrics["ate_rmse_m"].value)
    return np.array(found)


def test_on_a_known_world_the_semantic_map_beats_its_raster(world):
    """By its resolution and by its exactness: it is ahead with the raster's cells as well."""
    raster = errors_m(world, "known.yaml", "maps.wall_depth_m=0")
    assert raster.mean() < errors_m(world, "known.yaml").mean()
    assert (errors_m(world, "known.wkmap.urdf") < 0.8 * raster).all()
    assert errors_m(world, "known.wkmap.urdf", "maps.cell_m=0.05").mean() < raster.mean()


def test_from_nowhere_it_finds_itself_in_a_semantic_map(wallkit, tmp_path, world):
    done = wallkit(
        "localize", world / "drive0/log.mcap", "--map", world / "known.wkmap.urdf", "--init", "global", "-o", "run"
    )
    assert done.code == 0, done.err
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["health"] == "LOCALIZED"
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert {entry["path"] for entry in run["inputs"]} == {
        str(world / "drive0/log.mcap"),
        str(world / "known.wkmap.urdf"),
    }


def test_a_faulty_map_ends_the_command_before_anything_is_written(wallkit, tmp_path, world):
    broken = (world / "known.wkmap.urdf").read_text().replace('<parent link="map"/>', '<parent link="mop"/>', 1)
    (tmp_path / "broken.wkmap.urdf").write_text(broken)
    done = wallkit("localize", world / "drive0/log.mcap", "--map", "broken.wkmap.urdf", "-o", "run")
    assert (done.code, done.out) == (2, "")
    assert "mop" in done.err
    assert "wallkit map validate broken.wkmap.urdf" in done.err
    assert "Traceback" not in done.err
    assert not (tmp_path / "run").exists()


@pytest.mark.long
@pytest.mark.data
def test_an_imported_raster_localizes_as_well_as_itself(wallkit, tmp_path, data):
    log, chart = data / "logs/carmen/intel.mcap", data / "logs/carmen/intel.map.yaml"
    (draft,) = import_map(chart, ImportOptions(scan_plane_m=0.3)).drafts
    (tmp_path / "intel.wkmap.urdf").write_bytes(write_draft(draft))
    errors = []
    for one in (chart, "intel.wkmap.urdf"):
        done = wallkit("localize", log, "--map", one, "--init", "truth", "-o", "run", "--overwrite", "-q")
        assert (done.code, done.err) == (0, "")
        errors.append(json.loads((tmp_path / "run" / "metrics.json").read_text())["ate_rmse_m"])
    assert errors[1] <= errors[0] + 0.02
