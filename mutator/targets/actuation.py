"""Where a target's commands can be changed on their way to the plant, and which these are."""

from dataclasses import dataclass

from mutator.model import FaultLocation
from mutator.targets.observed_values import ObservedValue


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command to the plant. `text` is an expression at the place that can be read and assigned.

    `lowest` and `highest` bound what a defence commands; a change up to `tolerance` is no activation.
    """

    name: str
    text: str
    unit: str
    about: str
    lowest: float
    highest: float
    tolerance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuation:
    """The place at which defences change commands. `senses` are the controller's values there."""

    location: FaultLocation
    commands: tuple[Command, ...]
    senses: tuple[ObservedValue, ...]
