"""How one run of a target is carried out: the reference engine, and the faster ones.

What a run's output means never lives here.
"""
