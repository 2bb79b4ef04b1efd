"""What the `dataset` commands do."""
