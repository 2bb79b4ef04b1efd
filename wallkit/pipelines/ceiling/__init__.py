"""What the `ceiling` commands do."""
