"""Fault specs, fault models, parameters and injections, and their expansion into faults.

This package does not change source code or create triggers.
"""
