"""The words of the `bench` commands."""
