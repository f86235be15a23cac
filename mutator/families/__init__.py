"""Families: scenarios with parameters (ISO 34501's logical scenarios), and the concrete scenarios that they
give.
"""
