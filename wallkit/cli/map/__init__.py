"""The words of the `map` commands."""
