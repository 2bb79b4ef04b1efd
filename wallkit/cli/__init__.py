"""Words -> pipelines; the only floor that prints or exits."""
