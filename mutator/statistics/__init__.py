"""What the results of a campaign say: pure functions from a frame of results to tables with intervals.

Nothing here reads a run folder or draws.
"""
