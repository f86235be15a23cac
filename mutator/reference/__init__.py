"""Generates the reference pages and JSON Schemas. A test checks that the committed files are up to date."""
