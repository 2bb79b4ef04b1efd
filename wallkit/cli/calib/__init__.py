"""The words of the `calib` commands."""
