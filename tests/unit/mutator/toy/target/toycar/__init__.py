"""A car that follows another one: the smallest target there is."""
