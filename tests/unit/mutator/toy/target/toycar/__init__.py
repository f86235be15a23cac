"""A car that follows another one: a minimal target."""
