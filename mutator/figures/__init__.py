"""Figures of results and runs, drawn from frames or traces. This package does not compute statistics or read
run folders."""
