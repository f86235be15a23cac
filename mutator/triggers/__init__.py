"""When a fault is active: conditions over observed values, and the kinds of triggers.

This package does not select triggers for a campaign or know what a fault does.
"""
