"""The results table: its columns, how records become rows, how it is written, read, counted and ranked.

The table is derived from the records, so it can be built again at any time.
"""
