"""What the `simulate` commands do."""
