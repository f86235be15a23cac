"""Holding the controller's traces against references: reading, measuring, reporting."""
