"""Batches drawn for the tests: some logs, some configurations, and a known gain of each."""

import numpy as np

from wallkit.pipelines.batch.gather import Row, gather
from wallkit.pipelines.batch.labels import labels_of_runs
from wallkit.pipelines.batch.runs import DONE, FAILED

PLACES, PEOPLE, TAKES, SEEDS = ("hall", "lab", "office"), (0, 2, 12), (1, 2), (0, 1, 2)


def drawn_rows(gains, *, left_out=(), failing=(), noise=0.03, seed=0):
    """A row for every configuration, log and seed; a gain is a factor of the error, or a function of the people.

    Args:
        left_out, failing: (configuration, log, seed) of runs that are not there, and that failed.
    """
    rng = np.random.default_rng(seed)
    for place in PLACES:
        for people in PEOPLE:
            for take in TAKES:
                log, base = f"{place}-{people}-{take}", rng.gamma(6, 0.005)
                for name, gain in gains.items():
                    factor = gain(people) if callable(gain) else gain
                    for s in SEEDS:
                        error = base * factor * rng.normal(1, noise)
                        if (name, log, s) not in left_out:
                            yield _row(name, log, people, s, error, is_failed=(name, log, s) in failing)


def drawn(gains, **options):
    return gather(drawn_rows(gains, **options), labels_of_runs())


def _row(name, log, people, seed, error, *, is_failed):
    metrics = {
        "error_mean_m": error,
        "updates_to_converge": None if error > 0.5 else 10.0 + people,
        "lost_episodes": 1.0,
        "lost_share": 0.1,
        "false_healthy": float(error > 0.5),
        "update_mean_ms": 5.0 if name == "basic" else 20.0,
        "cpu_percent": 99.0,
        "peak_memory_mb": 300.0,
    }
    return Row(
        f"{name}/{log}/{seed}", name, log, (log, "floor.yaml", ""), seed, FAILED if is_failed else DONE,
        "no scans on /scan\nat line 3" if is_failed else "", f"runs/{name}/{log}/{seed}",
        {"crowd": str(people)}, {"points.filters": name, "localize.count": 500}, {} if is_failed else metrics,
    )  # fmt: skip
