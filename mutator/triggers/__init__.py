"""When a fault is active: conditions over observed values, and the kinds of triggers made of them.

Which triggers a campaign uses, and what a fault does once it is active, never lives here.
"""
