"""What a run folder holds and how it is read and written: plan, records, checks, shards.

What the stored things mean, and who may decide on them, never lives here.
"""
