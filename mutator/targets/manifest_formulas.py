"""Conditions and formulas of a manifest over recorded values."""

from collections.abc import Collection

from mutator.config.yaml_sources import Keys, Source
from mutator.triggers.conditions import check_condition, check_formula


def condition(text: str | None, known: Collection[str], source: Source, keys: Keys) -> str:
    """Return the condition in canonical text ('' for none). It may use the names `known`; MutatorError at
    `keys` of the manifest.
    """
    if text is None:
        return ""
    with source.placing(keys):
        return check_condition(text, variables=known, over_time=True)


def formula(text: str | None, known: Collection[str], source: Source, keys: Keys) -> str:
    """Return the formula in canonical text; otherwise like `condition`."""
    if text is None:
        return ""
    with source.placing(keys):
        return check_formula(text, known, over_time=True)
