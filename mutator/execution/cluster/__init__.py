"""Campaigns on many machines that share only the network.

The command distributes pieces of work (`board`), each with its lines of the plan, and writes results into the
run folder (`intake`). A worker gets the target in a bundle (`bundle`), makes its own golden runs, and runs
pieces in a separate process (`child`), which its `host` supervises. None of these knows about transport. Dask
provides that (`dask_workers`, `dealing`, `calls`, and `dask_side` on the workers; the extra `cluster`);
`where` names the cluster.
"""
