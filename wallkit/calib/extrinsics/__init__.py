"""Boards seen by both -> where the LiDAR is to the camera, and how sure that is; start at `extrinsics`."""
