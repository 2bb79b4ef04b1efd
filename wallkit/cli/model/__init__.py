"""The words of the `model` commands."""
