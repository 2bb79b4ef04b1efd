"""Unit, definition and better side of every number a run can have, from the code that computes them."""

from __future__ import annotations

import numpy as np

from wallkit.core.results import Value
from wallkit.core.steps import Steps
from wallkit.core.types import Health, Trajectory
from wallkit.evaluate.resources import mark_now, usage_since
from wallkit.pipelines.evaluate import EvaluateSettings, evaluate_steps
from wallkit.pipelines.watch import NO_FILTERING


def labels_of_runs() -> dict[str, Value]:
    """By key, without values: a run of two scans is judged, and its numbers are thrown away."""
    stamps_ns, nothing, ones = np.array([0, 10**9]), np.zeros(2), np.ones(2, dtype=np.int64)
    poses = np.array([[0.0, 0, 0], [1, 0, 0]])
    health = np.full(2, int(Health.LOCALIZED))
    steps = Steps(stamps_ns, poses, poses, health, nothing, nothing, nothing, nothing, ones, ones, nothing, ("", ""))
    judged = evaluate_steps(steps, Trajectory(stamps_ns, poses), EvaluateSettings()).metrics
    found = {**judged, **NO_FILTERING.values(), **usage_since(mark_now())}
    return {key: Value(key, None, v.unit, v.definition, v.better) for key, v in found.items()}
