"""Check that a defence fits a target."""

from mutator._common.message_text import describe_choices, spelling_suggestion
from mutator.config.yaml_source_lines import KeyPath
from mutator.defences.defence import Defence
from mutator.errors import MutatorError
from mutator.targets.actuation import Actuation
from mutator.targets.manifest import TargetManifest


def checked_actuation(manifest: TargetManifest, defence: Defence) -> Actuation:
    """Return the target's actuation; MutatorError if it has none, or if the defence uses what it lacks."""
    actuation = manifest.actuation
    if actuation is None:
        raise MutatorError(
            f"target {manifest.name} cannot be defended",
            where=manifest.path,
            expected="`actuation` in its manifest",
            remedy="say where its commands can be changed",
        )
    truth = [name for name in manifest.observation.variables if name != "t"]
    controller = [value.name for value in actuation.senses]
    for sense in defence.senses:
        key, names = ("truth", truth) if sense.is_truth else ("controller", controller)
        _check_name(defence, ("senses", sense.name, key), sense.value, names)
    for i, command in enumerate(defence.commands):
        _check_name(defence, ("commands", i), command, [command.name for command in actuation.commands])
    return actuation


def _check_name(defence: Defence, keys: KeyPath, name: str, names: list[str]) -> None:
    if name not in names:
        raise defence.source.error(
            keys,
            f"'{name}'",
            expected=describe_choices(names) if names else "none, because the manifest declares none",
            remedy="correct the name, or declare it in the manifest" + spelling_suggestion(name, names),
        )
