"""Writes a first library for a user's controller from its source tree, which is read but never imported."""
