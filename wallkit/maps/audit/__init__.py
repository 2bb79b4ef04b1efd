"""A map and the scans of a log -> what the log says about every element of the map; start at `audit`."""
