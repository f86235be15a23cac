"""Figures of results and runs, drawn from frames or traces. Nothing here counts, tests, or reads a run
folder."""
