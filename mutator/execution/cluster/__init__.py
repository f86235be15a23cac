"""Campaigns on many machines that share only the network.

The command distributes pieces of work (`board`) and writes the results into the run folder (`intake`). A
worker gets the target in a `bundle` and runs pieces in a separate process (`child`), which its `host`
supervises. Dask (extra `cluster`) is the transport: `dask_workers`, `dealing`, `calls`, `dask_side`. `where`
parses the user's choice of a cluster.
"""
