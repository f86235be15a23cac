"""Campaigns on many machines that share only the network.

The command distributes pieces of work (`piece_queue`) and writes the results into the run folder
(`result_intake`). A worker gets the target in a `bundle` and runs pieces in a separate process
(`piece_process`), which its `worker_host` supervises. Dask (extra `cluster`) is the transport:
`cluster_distributor`, `work_dispatcher`, `worker_calls`, `worker_tasks`. `cluster_choice` parses the user's
choice of a cluster.
"""
