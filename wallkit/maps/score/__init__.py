"""Can a robot tell where it is in this map? Start at `score`."""
