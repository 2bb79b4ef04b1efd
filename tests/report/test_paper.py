"""The table of a paper: a row for each configuration, over all runs."""

from __future__ import annotations

from wallkit.core.results import Comparison, Value
from wallkit.evaluate.statistics import summarise
from wallkit.report.compare import CompareData, Contender
from wallkit.report.paper import paper_differences, paper_headers, paper_rows


def run(error_m: float, updates: float | None) -> dict[str, Value]:
    return {
        "error_mean_m": Value("error_mean_m", error_m, "m", ""),
        "updates_to_converge": Value("updates_to_converge", updates, "updates", ""),
        "update_mean_ms": Value("update_mean_ms", 25.494, "ms", ""),
        "cpu_percent": Value("cpu_percent", 50.4, "%", ""),
        "peak_memory_mb": Value("peak_memory_mb", 120.0, "MB", ""),
        "false_healthy": Value("false_healthy", 2.0, "scans", ""),
    }


def test_means_and_the_sd_over_runs():
    runs = [run(0.04, 50), run(0.06, 60), run(0.05, None)]
    several = Contender("basic", runs[0], summarise(runs))
    alone = Contender("one", run(0.0345, 42), {})
    bare = Contender("no truth", {"update_mean_ms": runs[0]["update_mean_ms"]}, {})
    rows = paper_rows(CompareData("", "", (several, alone, bare)))
    assert paper_headers()[:3] == ["configuration", "runs", "converged"]
    assert rows[0] == ["basic", "3", "2", "25.49 ms", "50 %", "5.00 cm", "55.0", "1.00 cm", "120 MB", "2"]
    found = Comparison("error_mean_m", "m", -0.0102, -0.0153, -0.005, 0.03125, 6, "Wilcoxon", "b")
    said = paper_differences(CompareData("", "", (several, alone), (("basic", "one", found),)))
    numbers = "one - basic = -1.02 cm (95 % between -1.53 cm and -0.50 cm) [p = 0.031, 6 pairs, Wilcoxon]"
    assert said == [f"error_mean_m: one is better: {numbers}"]
    assert rows[1] == ["one", "1", "1", "25.49 ms", "50 %", "3.45 cm", "42.0", "-", "120 MB", "2"]
    assert rows[2] == ["no truth", "1", "-", "25.49 ms", "-", "-", "-", "-", "-", "-"]
