"""Read and write a run folder: plan, records, checks, shards.

This package stores results and does not interpret them.
"""
