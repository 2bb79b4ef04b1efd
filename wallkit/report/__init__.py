"""Numbers -> pages."""
