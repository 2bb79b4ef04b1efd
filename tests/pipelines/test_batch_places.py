"""Where runs fail: errors land in the square the robot truly was in, and every run counts once in it."""

import json

import numpy as np
import pytest

from wallkit.core.types import OccupancyGrid, Trajectory
from wallkit.evaluate.tum import write_tum
from wallkit.pipelines.batch.gather import Row, gather
from wallkit.pipelines.batch.places import read_places
from wallkit.pipelines.batch.runs import DONE
from wallkit.pipelines.evaluate import EvaluateSettings
from wallkit.report.batch_map import Places, _painted, cell_size, places_figure
from wallkit.report.walls import View

SECOND = 10**9


def write_run(folder, truth_xy, error_m, sha="m"):
    """A run that is `error_m` (T,) to the left of the truth (T, 2), one pose a second."""
    folder.mkdir(parents=True)
    stamps_ns, poses = np.arange(len(truth_xy)) * SECOND, np.column_stack([truth_xy, np.zeros(len(truth_xy))])
    write_tum(folder / "truth.tum", Trajectory(stamps_ns, poses))
    off = np.column_stack([np.zeros(len(error_m)), error_m, np.zeros(len(error_m))])
    write_tum(folder / "estimate.tum", Trajectory(stamps_ns, poses + off))
    inputs = [{"path": f"{sha}/map.yaml", "sha256": sha}]
    (folder / "run.json").write_text(json.dumps({"map": f"{sha}/map.yaml", "inputs": inputs}))


def runs_in(tmp_path, folders):
    rows = [Row(name, "basic", log, (log,), seed, DONE, folder=str(tmp_path / name)) for name, log, seed in folders]
    return gather(rows, {})


def test_means_by_square_with_each_run_once(tmp_path):
    # a robot that stands still for nine seconds and one that passes: both count once
    write_run(tmp_path / "a", np.array([[0.05, 0.05]] * 9 + [[4.05, 0.05]]), np.array([0.2] * 9 + [2.0]))
    write_run(tmp_path / "b", np.array([[0.05, 0.05], [4.05, 0.05]]), np.array([0.4, 0.0]))
    write_run(tmp_path / "c", np.array([[1.0, 1.0], [2.0, 2.0]]), np.array([0.0, 0.0]), sha="other")
    write_run(tmp_path / "d", np.array([[1.0, 1.0], [2.0, 2.0]]), np.array([0.0, 0.0]))
    (tmp_path / "d" / "truth.tum").unlink()
    runs = runs_in(tmp_path, [("a", "hall-1", 0), ("b", "hall-2", 0), ("d", "hall-1", 1), ("c", "lab-1", 0)])
    hall, lab = read_places(runs, EvaluateSettings())
    assert (hall.name, hall.runs, hall.logs, hall.unread) == ("hall", 2, 2, 1)
    assert (lab.name, lab.runs, lab.unread) == ("lab-1", 1, 0)
    assert hall.cell_m == 0.1
    assert hall.cells.tolist() == [[0, 0], [40, 0]]
    assert hall.error_m == pytest.approx([0.3, 1.0])
    assert hall.lost == pytest.approx([0.0, 0.5])
    assert hall.passes.tolist() == [2, 2]


def test_adding_up_in_between_changes_nothing(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    names = []
    for i in range(6):
        write_run(tmp_path / str(i), rng.uniform(0, 6, (30, 2)), rng.uniform(0, 1.5, 30))
        names.append((str(i), "hall", i))
    runs = runs_in(tmp_path, names)
    (whole,) = read_places(runs, EvaluateSettings())
    monkeypatch.setattr("wallkit.pipelines.batch.places._ROWS", 40)
    (parts,) = read_places(runs, EvaluateSettings())
    assert parts.cells.tolist() == whole.cells.tolist()
    assert parts.error_m == pytest.approx(whole.error_m)
    assert parts.passes.tolist() == whole.passes.tolist()


def places(lost=0.0):
    grid = OccupancyGrid(np.full((40, 60), 0, dtype=np.int8), 0.1, np.zeros(3), "floor.yaml")
    grid.cells[:, 0] = 100
    cells = np.array([[0, 0], [1, 0], [1, 1]])
    return Places("floor", grid, 1.0, cells, np.array([0.02, 0.2, 3.0]), np.full(3, lost), np.array([4, 4, 2]), 4, 2, 1)


def test_the_picture_has_the_square_where_it_is():
    picture = _painted(places(), View(0, 0, 6, 4), (60, 40), np.array([0, 2, 4]))
    # row 0 is the top; the wall at x = 0 stays
    assert picture[35, 5] == 3
    assert picture[35, 15] == 5
    assert picture[25, 15] == 7
    assert picture[25, 5] == 1
    assert (picture[:, 0] == 2).all()


def test_the_figure_says_the_worst_place_and_what_was_not_read():
    figure = places_figure(places())
    assert "round (1.5, 1.5) m: 3.00 m in 2 runs" in figure.caption
    assert "1 runs left no trajectory" in figure.caption
    assert b"scans lost" not in figure.svg
    assert b"scans lost" in places_figure(places(lost=0.4)).svg
    assert cell_size(np.array([[0.0, 0.0], [200.0, 10.0]])) == 2.0
