"""Shared helpers: files, hashing, random streams, locks, interrupts, text, tables.

They know no fault, target or campaign.
"""
