"""What changed between two maps, and one map out of two that were changed."""
