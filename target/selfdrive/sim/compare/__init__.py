"""Compares the controller's traces with references: reading, measuring, reporting."""
