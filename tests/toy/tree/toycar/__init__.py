"""A car that follows another, for tests."""
