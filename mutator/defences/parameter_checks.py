"""Check what a defence makes of its commands, and the units that it compares."""

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from mutator.config.yaml_source_lines import KeyPath
from mutator.defences.defence import Defence
from mutator.targets.actuation import Command
from mutator.triggers.conditions import names_in, parse_expression

_BOUNDING_WORDS = ("lowest", "highest")


def check_parameters(defence: Defence) -> None:
    """Check that each parameter is used, that each command has a bound if the model needs one, and that the
    model commands nothing else; MutatorError otherwise.

    The defence's commands must be the target's, or the error can blame a parameter for a misspelt command.
    """
    model = defence.model_file
    used = {*defence.model_parameters, *defence.names_in_formulas}
    for parameter in defence.parameters:
        if parameter.name not in used:
            raise defence.source.error(
                ("parameters", parameter.name),
                f"nothing uses '{parameter.name}'",
                expected=f"a parameter of the model ({model.describe_parameters(defence.commands)}), of a "
                "condition or of a formula",
                remedy="correct its name, or remove it",
            )
    for i, command in enumerate(defence.commands):
        bounds = [f"{word}_{command}" for word in model.bounds or ()]
        if bounds and not {command, *bounds} & {*model.commands, *defence.model_parameters}:
            raise defence.source.error(
                ("commands", i),
                f"nothing changes '{command}'",
                expected=f"a parameter {' or '.join(bounds)} for model {defence.model}",
                remedy="add a bound, or remove the command",
            )
    for command in model.commands:
        if command not in defence.commands:
            raise defence.source.error(
                ("commands",),
                f"no '{command}'",
                expected=f"it, because model {defence.model} always commands it",
                remedy="add the command, or name another model",
            )


def check_bounds(defence: Defence, commands: Sequence[Command]) -> None:
    """Check that bounds of commands have the commands' units and lie within their limits; MutatorError
    otherwise. These are parameters `lowest_<command>` and `highest_<command>`, and those of the model named
    `full_<command>` and `<command>_<number>` if their unit is the command's.
    """
    for command in commands:
        if command.name not in defence.commands:
            continue
        names = [f"{word}_{command.name}" for word in _BOUNDING_WORDS]
        for key, values in (("parameters", defence.parameters), ("derived", defence.derived)):
            for value in values:
                if value.name in names and value.unit != command.unit:
                    raise defence.source.error(
                        (key, value.name, "unit"),
                        f"'{value.unit}' for '{value.name}'",
                        expected=f"'{command.unit}', the unit of the target's command {command.name}",
                        remedy="convert the number to this unit, or correct the unit",
                    )
        pattern = re.compile(rf"full_{re.escape(command.name)}|{re.escape(command.name)}_\d+")
        for parameter in defence.parameters:
            is_bound = parameter.name in names or (
                parameter.name in defence.model_parameters
                and parameter.unit == command.unit
                and pattern.fullmatch(parameter.name)
            )
            if is_bound and not command.lowest <= parameter.value <= command.highest:
                raise defence.source.error(
                    ("parameters", parameter.name, "value"),
                    f"{parameter.value:g} for '{parameter.name}'",
                    expected=f"{command.lowest:g} to {command.highest:g}, the limits of the target's command "
                    f"{command.name}",
                    remedy="correct the number, or the limits in the manifest",
                )


def check_compared_units(defence: Defence, unit_by_sense: Mapping[str, str]) -> None:
    """Check that a parameter is compared with values of its own unit only; MutatorError otherwise.

    Only what has one unit whatever its numbers are is compared: names, their absolute values, the smallest
    and largest of some, and sums. Of a product, the unit is not computed.
    """
    parameters = {parameter.name: parameter.unit for parameter in defence.parameters}
    units = {**unit_by_sense, **parameters, **{value.name: value.unit for value in defence.derived}}
    for keys, text in _texts_by_keys(defence):
        for node in ast.walk(parse_expression(text)):
            if not isinstance(node, ast.Compare):
                continue
            sides = [node.left, *node.comparators]
            for left, right in pairwise(sides):
                texts = [ast.unparse(side) for side in (left, right)]
                names = {name for side in texts for name in names_in(side)}
                of_left, of_right = _unit_of(left, units), _unit_of(right, units)
                if of_left and of_right and of_left != of_right and names & parameters.keys():
                    raise defence.source.error(
                        keys,
                        f"{texts[0]} in '{of_left}' compared with {texts[1]} in '{of_right}'",
                        expected="values of the same unit",
                        remedy="convert one of them, or correct its unit",
                    )


def _texts_by_keys(defence: Defence) -> Iterator[tuple[KeyPath, str]]:
    yield ("acts_when",), defence.acts_when
    yield ("lets_go_when",), defence.lets_go_when
    for value in defence.derived:
        yield ("derived", value.name, "is"), value.text


def _unit_of(node: ast.expr, units: Mapping[str, str]) -> str | None:
    """Return the unit of an expression; None if it cannot be decided."""
    match node:
        case ast.Name(id=name):
            return units.get(name)
        case ast.UnaryOp(operand=operand):
            return _unit_of(operand, units)
        case ast.Call(func=ast.Name(id="abs" | "min" | "max" | "hypot"), args=parts):
            pass
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            parts = [left, right]
        case _:
            return None
    first, *others = {_unit_of(part, units) for part in parts} or {None}
    return None if others else first
