"""Compile-time fault injection for driving controllers: from fault specs to verdicts."""

__version__ = "0.1.0"
