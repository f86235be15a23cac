"""Drives the campaigns that the pages about the published study report, and writes these pages.

`python -m mutator.paper.reproduce` is the command. Campaigns become run folders, run folders become tables,
and pages are rendered from the tables alone, so that `--check` can render them again.
"""
