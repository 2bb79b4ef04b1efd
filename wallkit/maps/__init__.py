"""Walls as rasters and as semantic maps: read, judged, edited, drawn, and made into what a filter reads."""
