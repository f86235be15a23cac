"""Helpers that know nothing of faults, targets or campaigns: files, hashing, locks, text, tables."""
