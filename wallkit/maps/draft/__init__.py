"""A floor plan before it is a file, and the file that comes of it; start at `draft`."""
