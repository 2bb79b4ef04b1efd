"""The verbs that change a map: each takes a context and arguments, and returns byte edits with the change in words."""
