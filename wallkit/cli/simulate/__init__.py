"""The words of the `simulate` commands."""
