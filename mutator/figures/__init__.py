"""What results and runs look like: figures drawn from a frame of results, or from traces.

Nothing here counts, tests, or reads a run folder.
"""
