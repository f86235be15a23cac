"""Review of generated diffs: mutants grouped by shape, decisions about the groups, the page and the gate.

Nothing here runs an experiment.
"""
