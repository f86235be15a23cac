"""Strict YAML files with a line number for each value, units in keys, and places in source code.

Other packages define the contents of each kind of file, such as fault specs, manifests and campaigns.
"""
