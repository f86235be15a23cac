"""What may go wrong: fault specs, fault models, parameters, injections, and their expansion into faults.

Source code is not read or changed here, and triggers are not made here.
"""
