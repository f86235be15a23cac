"""Fault specs, fault models, parameters and injections, and their expansion into faults.

This package does not read or change source code, and makes no triggers.
"""
