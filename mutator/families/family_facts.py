"""What a run states about its families of scenarios, so that readers need no family file."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterFacts:
    """A parameter. `key` is its key in the family file, with the unit, and the name of its column; `name` is
    without the unit; `unit` is the unit's symbol, '' without one.
    """

    key: str
    name: str
    unit: str
    is_text: bool  # whether any of its values is text

    def describe(self, value: object) -> str:
        """Return the value with name and unit: `ego 60 km/h`."""
        text = f"{value:g}" if isinstance(value, int | float) else str(value)
        return f"{self.name} {text}" + (f" {self.unit}" if self.unit else "")


@dataclass(frozen=True, slots=True, kw_only=True)
class FamilyFacts:
    """A family: its name, title and parameters."""

    name: str
    title: str
    parameters: tuple[ParameterFacts, ...]

    def describe(self, values: Mapping[str, object]) -> str:
        """Return a concrete scenario as texts have it: `follow, ego 60 km/h, gap 20 m`."""
        return ", ".join((self.name, *(p.describe(values[p.key]) for p in self.parameters)))


def merged_parameters(families: Iterable[FamilyFacts]) -> tuple[ParameterFacts, ...]:
    """Return the parameters of all families by their keys, each once; a key that is text in any is text."""
    merged: dict[str, ParameterFacts] = {}
    for family in families:
        for parameter in family.parameters:
            if parameter.key not in merged or parameter.is_text:
                merged[parameter.key] = parameter
    return tuple(merged.values())
