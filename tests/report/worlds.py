"""A small run to draw: a room of 8 x 6 m, a round trip, one stretch of being lost."""

from dataclasses import fields

import numpy as np

from wallkit.core.results import Episode, Errors, Limits, Value
from wallkit.core.steps import Steps
from wallkit.core.types import Health, OccupancyGrid, Trajectory
from wallkit.report.data import ReportData, Setting, Snapshot

SECOND = 1_000_000_000
SCANS = 60
LOST = slice(30, 40)


def room(yaw_rad=0.0):
    """Free inside four walls, unknown outside; the corner of cell (0, 0) is at (-1, -1)."""
    cells = np.full((140, 180), -1, dtype=np.int8)
    cells[10:130, 10:170] = 100
    cells[12:128, 12:168] = 0
    return OccupancyGrid(cells, 0.05, np.array([-1.0, -1.0, yaw_rad]), "room.yaml")


def round_trip():
    """An ellipse inside the room, one scan a second."""
    t = np.linspace(0, 2 * np.pi, SCANS)
    poses = np.column_stack([3 + 2 * np.cos(t), 2.5 + 1.5 * np.sin(t), t - np.pi])
    return Trajectory(np.arange(SCANS) * SECOND + 5, poses)


def steps(*, healthy=False):
    """5 cm off, but 2 m from scan 30 to 39, when it says LOST."""
    truth = round_trip()
    health = np.full(SCANS, Health.LOCALIZED)
    offset = np.full(SCANS, 0.05)
    if not healthy:
        offset[LOST], health[LOST] = 2.0, Health.LOST
        health[40:42] = Health.UNCERTAIN
    third = np.full(SCANS, 1 / 3)
    return Steps(
        stamps_ns=truth.stamps_ns,
        poses=truth.poses + np.column_stack([offset, np.zeros(SCANS), np.zeros(SCANS)]),
        sd=np.full((SCANS, 3), 0.03),
        health=health.astype(np.int64),
        hit_ratio=third,
        short_ratio=third / 2,
        long_ratio=third / 2,
        ess=np.full(SCANS, 500.0),
        particles=np.full(SCANS, 1000),
        modes=np.ones(SCANS, dtype=np.int64),
        update_ms=np.linspace(0.3, 0.6, SCANS),
        reasons=tuple("" if h == Health.LOCALIZED else "few beams end on the map" for h in health),
    )


def stretched(record, health):
    """The record's first row again and again, with the given health, one scan a second."""
    rows = len(health)
    repeated = {f.name: np.repeat(getattr(record, f.name)[:1], rows, axis=0) for f in fields(Steps)}
    repeated |= {"stamps_ns": np.arange(rows) * SECOND, "health": np.array(health), "reasons": ("",) * rows}
    return Steps(**repeated)


def run(**changes):
    """The whole of it, with truth, odometry, particles and settings."""
    record, truth = steps(), round_trip()
    offset = np.hypot(*(record.poses - truth.poses)[:, :2].T)
    rng = np.random.default_rng(0)
    cloud = np.column_stack([rng.normal(3, 0.3, 200), rng.normal(2, 0.3, 200), np.zeros(200)])
    values = {
        "title": "room.mcap on room.yaml",
        "verdict": "Localized, lost once for 10 s and recovered.",
        "tone": "good",
        "steps": record,
        "run": {"version": "0.1.0", "argv": ["wallkit", "localize", "a log.mcap"], "machine": {"cores": 2}},
        "metrics": {
            "ate_rmse_m": Value("ate_rmse_m", 0.818, "m", "root mean square distance"),
            "updates_to_converge": Value("updates_to_converge", 41.0, "updates", "updates until right"),
            "rpe_1m_rmse_m": Value("rpe_1m_rmse_m", None, "m", "motion error"),
        },
        "grid": room(),
        "truth": truth,
        "errors": Errors(record.stamps_ns, np.arange(SCANS), offset, np.zeros(SCANS)),
        "odometry": Trajectory(truth.stamps_ns, truth.poses * 1.02, "odom"),
        "episodes": (
            Episode(*(record.stamps_ns[[30, 40]].tolist()), *(record.stamps_ns[[30, 30]].tolist()), 0, None, 2, 0, 0),
        ),
        "limits": Limits(),
        "snapshots": tuple(Snapshot(n * SECOND, cloud, np.full(200, 0.005), f"update {n}") for n in (1, 30, 59)),
        "dropped": {"scans without odometry": 4},
        "settings": (Setting("localize.particles", 5000, 2000, "wallkit.toml:3"), Setting("seed", 0, 0)),
    }
    return ReportData(**{**values, **changes})
