"""Shared helpers: files, hashing, random streams, locks, interrupts, text and tables.

They do not depend on faults, targets or campaigns.
"""
