"""Strict YAML files with a line number for each value, units in keys, and places in source code."""
