"""Running experiments: sessions, workers, pytest, merged shards, single runs.

How results are shown never lives here.
"""
