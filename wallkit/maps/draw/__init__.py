"""A semantic map -> its floor plan as SVG, PNG or text; start at `plan`."""
