"""What the rules found in a file: judged, repaired, and written for people and for machines."""
