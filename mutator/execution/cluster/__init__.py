"""Runs on many machines, by Dask: where the cluster is, what its workers are sent, how work is dealt out.

Needs the extra `cluster`, and imports Dask only once a cluster is to be used. Nothing here decides what an
experiment's result is, and nothing but the command writes the run folder.
"""
