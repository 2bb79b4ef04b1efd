"""What `wallkit bench polygons` and `bench filter` time does what they say; how fast is for a quiet machine."""

from __future__ import annotations

import pytest

from wallkit.pipelines.bench import points as bench_points


@pytest.fixture(autouse=True)
def _briefly(monkeypatch):
    monkeypatch.setattr(bench_points, "ROUNDS", 2)


def test_all_ways_give_one_answer():
    parts = {part.name: part for part in bench_points.time_polygons(300, 10, 40)}
    assert {"crossing_number", "winding_number", "even_odd", "mask look-up"} < set(parts)
    for name in ("winding_number", "even_odd"):
        assert parts[name].note == "100.00% as crossing_number"
    assert float(parts["mask look-up"].note.split("%")[0]) > 97
    assert all(part.median_ms >= 0 for part in parts.values())


def test_a_filtered_update_is_compared_with_a_basic_one():
    parts = {part.name: part for part in bench_points.time_filter(200, 10, 40, 200)}
    for name in ("update, filtered", "update, filtered with margins, by scores", "update, basic, 240 returns"):
        assert "x basic" in parts[name].note
    assert {f"weights of {name}" for name in ("wall_mask", "soft_mask", "line_fit", "novelty")} < set(parts)
