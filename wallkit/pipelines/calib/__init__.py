"""What the `calib` commands do."""
