"""Generates the reference pages and JSON Schemas. A test compares the committed files."""
