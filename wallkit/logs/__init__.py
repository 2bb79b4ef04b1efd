"""Recordings in any common format -> decoded messages -> frames for the filter; results -> MCAP."""
