"""From a fault to changed source: anchors, splicing, rendering, patches, and the contract with the probe.

Nothing here runs a mutant or knows a campaign.
"""
