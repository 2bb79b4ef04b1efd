"""Rasters: map_server files, and the fields of distances that a filter reads."""
