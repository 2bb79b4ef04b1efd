"""Small trajectories that the tests of this room draw from."""

import numpy as np

from wallkit.core.geometry import compose
from wallkit.core.steps import Steps
from wallkit.core.types import Trajectory
from wallkit.evaluate.associate import Pairs


def loop(updates=60, start_ns=1_700_000_000_000_000_000, step_ns=100_000_000):
    """A closed curve with turns, driven at uneven speed."""
    t = np.linspace(0, 1, updates) ** 1.2
    x, y = 6 * np.sin(2 * np.pi * t), 3 * np.sin(4 * np.pi * t)
    yaw = np.arctan2(np.gradient(y), np.gradient(x))
    return Trajectory(start_ns + step_ns * np.arange(updates), np.column_stack([x, y, yaw]))


def disturbed(truth, seed=0, sigma_m=0.05, sigma_deg=1.0):
    """The same with white noise in every pose."""
    sigma = [sigma_m, sigma_m, np.deg2rad(sigma_deg)]
    noise = np.random.default_rng(seed).normal(0, sigma, truth.poses.shape)
    return Trajectory(truth.stamps_ns, truth.poses + noise)


def moved(trajectory, motion):
    """The whole trajectory after a rigid motion of the map."""
    return Trajectory(trajectory.stamps_ns, compose(np.asarray(motion, dtype=float), trajectory.poses))


def steps_with(health, update_ms=None):
    """A run record at one scan a second with the given health; every scan is an update unless told."""
    rows = len(health)
    blank = np.zeros(rows)
    return Steps(
        stamps_ns=np.arange(rows) * 1_000_000_000,
        poses=np.zeros((rows, 3)),
        sd=np.zeros((rows, 3)),
        health=np.array(health, dtype=np.int64),
        hit_ratio=blank,
        short_ratio=blank,
        long_ratio=blank,
        ess=blank,
        particles=np.ones(rows, dtype=np.int64),
        modes=np.ones(rows, dtype=np.int64),
        update_ms=np.ones(rows) if update_ms is None else np.array(update_ms, dtype=float),
        reasons=("",) * rows,
    )


def paired(estimate, truth):
    """Two trajectories with the same stamps as pairs."""
    return Pairs(estimate.stamps_ns, np.arange(len(estimate)), estimate.poses, truth.poses, {})
