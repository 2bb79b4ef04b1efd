"""What the ceiling's study counts as near, come, lost, found again and converged; and that a stopped study goes on."""

import math
from pathlib import Path

import numpy as np
import pytest

from wallkit.core.ceiling import CeilingMap
from wallkit.errors import OutputError
from wallkit.pipelines.bench.ceiling import MODELS, Outcome, Task, judged, summary
from wallkit.pipelines.bench.ceiling_picture import slopes_along
from wallkit.pipelines.bench.ceiling_rows import read_rows, task_of, write_rows

STAMPS = np.arange(300, dtype=np.int64) * 100_000_000
TASK = Task("hall", "patch", "own", "everywhere", "drive", None, 2)


def outcome_of(*near: tuple[int, int]) -> Outcome:
    """Of 30 s at 10 Hz that were 0.1 m off in these stretches of views, else 3 m."""
    errors = np.full((300, 2), 3.0)
    for start, end in near:
        errors[start:end] = 0.1, 0.01
    return judged(STAMPS, errors, np.arange(1, 301), 3.0)


def test_a_run_that_was_lost_came_back_and_stayed() -> None:
    run = outcome_of((50, 100), (130, 300))
    # near for a second, 10 views, at views 59 and 139
    assert run.converged
    assert run.first == 60
    assert run.updates == 131
    assert run.lost == 1
    assert run.back == (139 - 100,)
    assert run.error_m == pytest.approx(0.1)
    assert run.error_deg == pytest.approx(math.degrees(0.01))
    assert run.is_near.mean() == pytest.approx(220 / 300)
    assert run.seconds == pytest.approx(0.01)


def test_near_for_less_than_ten_seconds_at_the_end_is_not_converged() -> None:
    run = outcome_of((210, 300))
    assert not run.converged
    assert run.first == 220
    assert math.isnan(run.updates)
    assert math.isnan(run.error_m)


def test_a_glimpse_is_neither_come_nor_lost() -> None:
    run = outcome_of((50, 58))
    assert math.isnan(run.first)
    assert run.lost == 0
    assert run.back == ()


def test_a_loss_that_was_not_made_good_is_only_lost() -> None:
    run = outcome_of((10, 40), (60, 90))
    assert run.lost == 2
    assert run.back == (69 - 40,)


def test_rows_come_back_from_their_file_and_say_what_need_not_run_again(tmp_path: Path) -> None:
    row = summary(TASK, [outcome_of((50, 100), (130, 300)), outcome_of((50, 58))])
    assert (row.converged, row.came, row.lost, row.back, row.back_updates) == (1, 1, 1, 1, 39)
    write_rows(tmp_path / "study.csv", [row])
    (again,) = read_rows(tmp_path / "study.csv")
    assert task_of(again) == TASK
    write_rows(tmp_path / "again.csv", [again])
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "study.csv").read_bytes()
    assert again.share_near == pytest.approx(row.share_near, rel=1e-5)
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    with pytest.raises(OutputError, match="holds no rows"):
        read_rows(tmp_path / "other.csv")


def test_the_first_localizer_sees_unblurred_views() -> None:
    assert {name: Task("", name, "own", "", "", None, 1).settings.ceiling.smooth_m for name in MODELS} == {
        "seed": 0.0, "centre": 0.04, "histogram": 0.04, "gradient": 0.04, "patch": 0.04
    }  # fmt: skip


def test_the_slope_of_a_ramp_is_that_of_the_ramp() -> None:
    # red rises by 1 in 4 m along x, green by 1 in 2 m along y
    y, x = np.mgrid[0:200, 0:400] * 0.01
    pixels = np.stack([255 * x / 4, 255 * y / 2, np.zeros_like(x)], axis=2).round().astype(np.uint8)
    ceiling = CeilingMap(pixels, np.ones(pixels.shape[:2], bool), 0.01, np.array([5.0, 1.0, 0.0]), 2.7, "ramp")
    slopes = slopes_along(ceiling, np.array([[6.0, 2.0, 0.0], [8.0, 2.5, 1.0]]))
    np.testing.assert_allclose(slopes, math.hypot(1 / 4, 1 / 2), rtol=0.02)
