"""A world that answers back: plans, people, sensors and odometry with exact truth."""
