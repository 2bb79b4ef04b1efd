"""Corners in several views -> the camera's intrinsics, and how far to trust them; start at `intrinsics`."""
