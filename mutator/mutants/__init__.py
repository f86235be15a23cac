"""From a fault to changed source: anchors, splicing, rendering, patches, and the probe's contract.

This package does not run mutants and knows no campaigns.
"""
