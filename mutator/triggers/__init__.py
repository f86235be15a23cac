"""When a fault is active: conditions over observed values, and the kinds of triggers.

This package neither selects triggers for a campaign nor knows what a fault does.
"""
