"""What the results of a campaign look like: figures drawn from a frame of results."""
