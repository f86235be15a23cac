"""The report of a run: page, sections, plots, series and films that people look at.

Numbers come from `statistics`; nothing here counts or tests.
"""
