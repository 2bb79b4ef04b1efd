"""Maps of walls -> occupancy and distance fields; later: authoring and validation."""
