"""A map and a route -> a log without people and pictures, as `wallkit simulate log` records it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.movers import NOISE
from wallkit.pipelines.simulate.log import LogRequest, simulate_log
from wallkit.simulate.crowd import Crowd
from wallkit.simulate.route import Route
from wallkit.simulate.scanner import Scanner
from wallkit.simulate.scenario import LidarSetup, OdometrySetup, Scenario

# coarse, and so quickly cast
LIDAR = Scanner(beams=180, rate_hz=4.0, range_max_m=12.0, sigma_m=0.015)


def record(chart: Path, route: Sequence[tuple[float, float]], out: Path, seed: int = 0) -> Path:
    """The log of a robot that drives straight from corner to corner in a map."""
    story = Scenario(
        route=Route(waypoints=tuple(route), direct=True, speed_m_s=0.6),
        crowd=Crowd(walkers=0),
        lidar=LidarSetup(scanner=LIDAR),
        odometry=OdometrySetup(wheels=NOISE),
    )
    simulate_log(LogRequest(chart, story, seed=seed), out)
    return out / "log.mcap"
