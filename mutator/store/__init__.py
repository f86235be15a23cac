"""The content of a run folder, and how to read and write it: plan, records, checks, shards.

This package stores results; it does not interpret them.
"""
