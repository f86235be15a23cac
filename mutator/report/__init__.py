"""The report of a run: its pages, panels, plots, series and films. Numbers come from `statistics`."""
