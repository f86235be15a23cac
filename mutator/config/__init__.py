"""How YAML enters: strict files with a line for each value, units in keys, places in source code.

What a particular file means (a fault spec, a manifest, a campaign) never lives here.
"""
