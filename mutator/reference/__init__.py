"""Generates the reference pages and JSON Schemas from the code and the library.

`python -m mutator.reference` writes them into the current clone; a test compares the committed files.
"""
