"""wallkit: where was the robot? Recorded LiDAR + camera logs, a map of walls, and a verdict."""

__version__ = "0.1.0"
