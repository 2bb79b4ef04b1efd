"""Many runs of many logs: made, kept, and read."""
