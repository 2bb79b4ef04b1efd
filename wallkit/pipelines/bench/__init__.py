"""What the `bench` commands do."""
