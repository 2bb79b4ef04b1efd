"""Odometry and labelled scans -> a belief over poses, an estimate, and how far to trust it."""
