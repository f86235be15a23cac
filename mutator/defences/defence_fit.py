"""Check that a defence fits a target."""

from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.yaml_source_lines import KeyPath
from mutator.defences.command_variables import check_commands_are_different
from mutator.defences.defence import Defence
from mutator.defences.parameter_checks import check_bounds, check_compared_units, check_parameters
from mutator.errors import MutatorError
from mutator.targets.actuation import Actuation
from mutator.targets.manifest import TargetManifest


def checked_actuation(manifest: TargetManifest, defence: Defence) -> Actuation:
    """Return the target's actuation. MutatorError if it has none, if two of its commands are one variable, if
    the defence or its model uses what the target lacks, and if the defence's bounds or units do not fit.
    """
    actuation = manifest.actuation
    if actuation is None:
        raise MutatorError(
            f"target {manifest.name} cannot be defended",
            where=manifest.path,
            expected="`actuation` in its manifest",
            remedy="say where its commands can be changed",
        )
    check_commands_are_different(manifest, actuation)
    truth = [name for name in manifest.observation.variables if name != "t"]
    controller = [value.name for value in actuation.senses]
    commands = [command.name for command in actuation.commands]
    for sense in defence.senses:
        key, names = ("truth", truth) if sense.is_truth else ("controller", controller)
        _check_name(defence, ("senses", sense.name, key), sense.value, names)
    for i, command in enumerate(defence.commands):
        _check_name(defence, ("commands", i), command, commands)
    for name, line in defence.model_file.applied.line_by_required_name:
        if name not in commands:
            raise defence.source.error(
                ("model",),
                f"'{defence.model}' reads the command '{name}' ({defence.model_path.name}:{line})",
                expected=f"one of {', '.join(commands)}, the commands of {manifest.name}",
                remedy="name another model, or declare the command in the manifest",
            )
    check_parameters(defence)
    check_bounds(defence, actuation.commands)
    check_compared_units(defence, _unit_by_sense(manifest, actuation, defence))
    return actuation


def _unit_by_sense(manifest: TargetManifest, actuation: Actuation, defence: Defence) -> dict[str, str]:
    observation = manifest.observation
    values = (*observation.values, *observation.derived)
    unit_by_value = {(True, value.name): value.unit for value in values}
    unit_by_value |= {(False, value.name): value.unit for value in actuation.senses}
    return {sense.name: unit_by_value[sense.is_truth, sense.value] for sense in defence.senses}


def _check_name(defence: Defence, keys: KeyPath, name: str, names: list[str]) -> None:
    if name not in names:
        raise defence.source.error(
            keys,
            f"'{name}'",
            expected=describe_choices(names) if names else "none, because the manifest declares none",
            remedy="correct the name, or declare it in the manifest" + spelling_suggestion(name, names),
        )
