"""Reviewing generated diffs: mutants grouped by shape, decisions about groups, and where these are shown."""
