"""The pytest plugin that runs campaigns (`--campaign`)."""
