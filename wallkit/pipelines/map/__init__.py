"""What the `map` commands do."""
