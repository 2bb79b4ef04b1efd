"""Where rooms meet: typed settings in, result dataclasses out, nothing printed."""
