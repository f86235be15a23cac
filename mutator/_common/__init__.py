"""Helpers that do not depend on faults, targets or campaigns: files, hashing, locks, text, tables."""
