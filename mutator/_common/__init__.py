"""What every part needs and no part owns: files, hashing, random streams, locks, interrupts, text, tables.

Nothing here knows a fault, a target or a campaign.
"""
