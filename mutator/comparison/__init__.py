"""Two runs of the same faults, experiment by experiment: what became better, worse, hazardous.

Nothing here runs an experiment or changes a run folder.
"""
