"""Conditions and formulas of a manifest over recorded values."""

from collections.abc import Collection

from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.triggers.conditions import canonical_condition, canonical_formula


def manifest_condition(text: str | None, names: Collection[str], source: YamlSource, keys: KeyPath) -> str:
    """Return the condition in canonical text ('' for none). It may use `names`; MutatorError at
    `keys` of the manifest.
    """
    if text is None:
        return ""
    with source.locating_errors(keys):
        return canonical_condition(text, variables=names, over_time=True)


def manifest_formula(text: str | None, names: Collection[str], source: YamlSource, keys: KeyPath) -> str:
    """Return the formula in canonical text; otherwise like `manifest_condition`."""
    if text is None:
        return ""
    with source.locating_errors(keys):
        return canonical_formula(text, names, over_time=True)
