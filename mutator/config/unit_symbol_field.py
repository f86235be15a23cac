"""The key `unit` of YAML models."""

from typing import Annotated

from pydantic import AfterValidator

from mutator.config.units import symbol_of_unit

UnitSymbol = Annotated[str, AfterValidator(symbol_of_unit)]
"""A unit in a manifest, read as suffix or symbol."""
