"""The report of a run: pages, panels, plots, series and films. The package `statistics` computes the
numbers.
"""
