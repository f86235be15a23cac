"""Strict YAML files with a line number for each value, units in keys, and places in source code.

What a particular file means (a fault spec, a manifest, a campaign) is defined elsewhere.
"""
