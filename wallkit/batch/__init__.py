"""Many runs -> one table that survives a sudden end."""
