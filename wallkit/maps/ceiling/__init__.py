"""Ceilings: their files, and how one is scaled and stitched from what a camera saw."""
