"""Trajectory -> numbers."""
