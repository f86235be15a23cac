"""Campaigns on many machines, which share nothing but the network.

The command deals out pieces of work (`board`), each with the lines of the plan that it needs, and writes what
comes back into the run folder (`intake`). A worker gets the target from a bundle (`bundle`), drives the
golden runs itself, and runs its pieces in a separate process (`child`), which its `host` watches over. None
of these knows how the bytes travel: that is Dask's part (`dask_workers`, `dealing`, `calls`, and `dask_side`
on the workers), which needs the extra `cluster`; `where` says which cluster it is.
"""
