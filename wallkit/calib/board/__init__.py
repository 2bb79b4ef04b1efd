"""The board: what it is, printed, and its corners in pictures."""
