"""Calibrations as files: wallkit's TOML, ROS and Kalibr YAML, a robot's URDF."""
