"""Campaigns on many machines, which share nothing but the network.

The command deals out pieces of work (`board`), each with the lines of the plan that it needs, and writes what
comes back into the run folder (`intake`). A worker has the target and the golden runs from a bundle
(`bundle`), and runs its pieces in a process of their own (`child`), which its `host` watches over. All of
these know nothing of what carries the bytes: that is `dask_workers`, and `dask_side` on the workers, who need
the extra `cluster`; `where` says which cluster it is.
"""
