"""Formats of `mutator import` that belong to the published study: each module is an importer, which the door
finds by the module's name. What they need stands beside this folder.
"""
