"""Turns a fault into changed source. This package does not run mutants and does not use campaigns."""
