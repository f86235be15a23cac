"""Check that the commands of an actuation are different variables.

They are assigned together, so of two commands that are one variable, the first value would be lost.
"""

import ast
from collections import Counter
from collections.abc import Mapping
from itertools import combinations

from mutator.targets.actuation import Actuation
from mutator.targets.manifest import TargetManifest

_Function = ast.FunctionDef | ast.AsyncFunctionDef
_Steps = tuple[str, ...]  # from a name to a variable: `a.b["x"]` is ("a", ".b", "['x'")


def check_commands_are_different(manifest: TargetManifest, actuation: Actuation) -> None:
    """Raise MutatorError if two commands are the same variable, or if one contains another.

    A variable of the function that stands for another expression throughout is taken for that expression.
    """
    steps_by_command = {
        command.name: _steps_of(ast.parse(command.text, mode="eval").body) for command in actuation.commands
    }
    if len({steps[0] for steps in steps_by_command.values()}) > 1:
        meanings = _meanings(manifest, actuation)
        steps_by_command = {
            name: (*meanings.get(steps[0], steps[:1]), *steps[1:]) for name, steps in steps_by_command.items()
        }
    text_by_command = {command.name: command.text for command in actuation.commands}
    for first, second in combinations(steps_by_command, 2):
        shorter, longer = sorted((first, second), key=lambda name: len(steps_by_command[name]))
        steps = steps_by_command[shorter]
        if steps == steps_by_command[longer][: len(steps)]:
            is_same = len(steps) == len(steps_by_command[longer])
            verb = "is the same variable as" if is_same else "is in the variable of"
            if is_same:
                shorter, longer = first, second
            raise manifest.source.error(
                ("actuation", "commands", longer, "is"),
                f"'{text_by_command[longer]}' of command {longer} {verb} "
                f"'{text_by_command[shorter]}' of command {shorter}",
                expected="a variable of its own for each command",
                remedy="remove one of the commands, or correct its variable",
            )


def _steps_of(node: ast.expr) -> _Steps:
    match node:
        case ast.Name(id=name):
            return (name,)
        case ast.Attribute(value=value, attr=name):
            return (*_steps_of(value), f".{name}")
        case ast.Subscript(value=value, slice=key):
            return (*_steps_of(value), f"[{ast.literal_eval(key)!r}")
    return (ast.unparse(node),)


def _meanings(manifest: TargetManifest, actuation: Actuation) -> Mapping[str, _Steps]:
    """Return what variables of the function stand for if they are set once, to an attribute or an item that
    the function does not set.
    """
    location = actuation.location
    data = manifest.tree.files.get(location.path)
    function = _find_function(ast.parse(data), location.function.split(".")) if data else None
    if function is None:
        return {}
    nodes = [*ast.walk(function)]
    assigned = Counter(
        ast.unparse(node)
        for node in nodes
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load)
    )
    assigned.update(node.arg for node in nodes if isinstance(node, ast.arg))
    meanings: dict[str, _Steps] = {}
    for node in nodes:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Attribute() | ast.Subscript() as value):
                if assigned[name] == 1 and not assigned[ast.unparse(value)] and _is_constant_chain(value):
                    meanings[name] = _steps_of(value)
    return meanings


def _is_constant_chain(node: ast.expr) -> bool:
    match node:
        case ast.Name():
            return True
        case ast.Attribute(value=value) | ast.Subscript(value=value, slice=ast.Constant()):
            return _is_constant_chain(value)
    return False


def _find_function(tree: ast.AST, names: list[str]) -> _Function | None:
    """Return the function with a qualified name, as a list of its parts."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, _Function | ast.ClassDef) and node.name == names[0]:
            if len(names) > 1:
                return _find_function(node, names[1:])
            return node if isinstance(node, _Function) else None
    return None
