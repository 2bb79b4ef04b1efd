"""What the `model` commands do."""
