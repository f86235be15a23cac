"""Statistics of a campaign: pure functions that turn a frame of results into tables with intervals."""
