"""Explorations: how large and how long a fault may be before a hazard follows."""
