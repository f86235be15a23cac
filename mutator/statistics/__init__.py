"""Statistics of a campaign: pure functions from a frame of results to tables with intervals."""
