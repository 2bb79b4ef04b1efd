"""Boards, corners, cameras and LiDARs: from captures to a calibration that says how far to trust it."""
