"""Run experiments: sessions, workers, pytest, merged shards, single runs.

This package does not present results.
"""
