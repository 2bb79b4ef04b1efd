"""LiDAR points meet what is known about them: labels, predictions, and a weight for each."""
