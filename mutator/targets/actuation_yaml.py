"""The actuation of a manifest."""

import math

from pydantic import Field

from mutator.config.location_syntax import is_assignable
from mutator.config.location_yaml import LocationModel
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.actuation import Actuation, Command
from mutator.targets.observation_yaml import (
    ValueModel,
    check_value_names,
    checked_expression,
    checked_statement_location,
)
from mutator.targets.observed_values import ObservedValue


class CommandModel(StrictModel, title="A command"):
    """A command on its way to the plant."""

    is_: str = Field(
        alias="is",
        description="The command at the place, which is read and assigned: a name, an attribute, or an item "
        "with a constant key.",
    )
    unit: UnitSymbol = Field(description="The unit, as symbol or suffix; `-` for none.")
    about: str = Field("", description="What the command means, and its sign.")
    lowest: float = Field(-math.inf, description="The lowest value that a defence can command.")
    highest: float = Field(math.inf, description="The highest value that a defence can command.")
    tolerance: float = Field(
        0.0, ge=0.0, allow_inf_nan=False, description="A change up to this is no activation."
    )


class ActuationModel(StrictModel, title="The actuation"):
    """Where [defences](defence.md) change commands: after the controller, before the plant, once in each
    step. The place may be in a file that `forbid` names.
    """

    at: LocationModel = Field(description="The place in the source at which the commands are changed.")
    commands: dict[str, CommandModel] = Field(min_length=1, description="Name -> a command.")
    senses: dict[str, ValueModel] = Field(
        default_factory=dict,
        description="Name -> a value of the controller at the place, as an expression like those of the "
        "[observation](#the-observation). A defence that uses it sees what faults do to it.",
    )


def build_actuation(model: ActuationModel | None, source: YamlSource) -> Actuation | None:
    if model is None:
        return None
    location = checked_statement_location(model.at, source, ("actuation", "at"))
    check_value_names({"commands": model.commands, "senses": model.senses}, source, "actuation")
    return Actuation(
        location=location,
        commands=tuple(_build_command(name, command, source) for name, command in model.commands.items()),
        senses=tuple(
            ObservedValue(
                name=name,
                text=checked_expression(value.is_, source, ("actuation", "senses", name, "is")),
                unit=value.unit,
                about=value.about,
            )
            for name, value in model.senses.items()
        ),
    )


def _build_command(name: str, model: CommandModel, source: YamlSource) -> Command:
    keys = ("actuation", "commands", name)
    if not is_assignable(model.is_):
        raise source.error(
            (*keys, "is"), f"'{model.is_}'", expected="a name, an attribute or an item with a constant key"
        )
    if not model.lowest < model.highest:
        raise source.error(
            (*keys, "lowest"), f"{model.lowest:g}", expected=f"less than `highest`, {model.highest:g}"
        )
    return Command(
        name=name,
        text=checked_expression(model.is_, source, (*keys, "is")),
        unit=model.unit,
        about=model.about,
        lowest=model.lowest,
        highest=model.highest,
        tolerance=model.tolerance,
    )
