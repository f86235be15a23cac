"""Puts defences into a target's tree: a runtime, a copy of each model, and three kinds of lines."""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below
from mutator.config.location_syntax import DEFENCE_MODULE_NAME, PROBE_MODULE_NAME, base_variable
from mutator.defences.defence import Defence
from mutator.defences.defence_fit import checked_actuation
from mutator.errors import MutatorError
from mutator.mutants.defence_runtime import defence_module_names, module_path, render_runtime
from mutator.mutants.name_scopes import normalize_identifier, rescoped_names
from mutator.mutants.parsed_files_and_anchors import ParsedFile, ResolvedAnchor, parsed_file
from mutator.mutants.splicing import LineEdit, apply_edits, defence_edit, defence_import_edit, mutated_bytes
from mutator.targets.actuation import Actuation
from mutator.targets.defence_lines import defence_tag_of, without_defence_lines
from mutator.targets.manifest import TargetManifest
from mutator.targets.observed_values import Observation

_MOST_TEMPLATE_BYTES = 100_000
RUNTIME_TEMPLATE_FILE = f"{DEFENCE_MODULE_NAME}.py.j2"


def defended_manifest(
    manifest: TargetManifest, defences: Sequence[Defence], templates: Path
) -> TargetManifest:
    """Return the target with these defences in its tree; without any, the manifest itself.

    MutatorError if the target has no actuation, if a defence does not fit it, or if its files have lines or
    names that defences use.
    """
    if not defences:
        return manifest
    ordered = sorted(defences, key=lambda defence: defence.priority)
    for defence in ordered:
        actuation = checked_actuation(manifest, defence)
    _check_names_are_free(manifest, ordered)
    path = templates / RUNTIME_TEMPLATE_FILE
    runtime = render_runtime(
        manifest, actuation, ordered, read_bounded(path, _MOST_TEMPLATE_BYTES).decode(), path
    )
    package = manifest.probe_package
    added = {module_path(package, DEFENCE_MODULE_NAME): runtime.encode()} | {
        module_path(package, name): defence.model_code
        for name, defence in zip(defence_module_names(ordered), ordered, strict=True)
    }
    files = {**_changed_files(manifest, actuation, ordered), **added}
    defended = replace(
        manifest, defences={defence.name: defence.digest for defence in ordered}, defence_files=files
    )
    vars(defended)["tree"] = manifest.tree.with_changes(files)  # the cached property: no second reading
    return defended


def _changed_files(
    manifest: TargetManifest, actuation: Actuation, defences: Sequence[Defence]
) -> Mapping[str, bytes]:
    edits: dict[str, list[LineEdit]] = {}
    observation, package = manifest.observation, manifest.probe_package
    for location, code, tag in (
        (observation.location, _observation_call(observation), "observe"),
        (actuation.location, _command_call(actuation, defences), "command"),
    ):
        file = parsed_file(manifest.tree, location.path)
        anchor = file.resolve_statement(location)
        edit = defence_edit(file, anchor, code, tag)
        if tag == "command":
            _check_commands_are_known(file, anchor, actuation, edit, manifest)
        edits.setdefault(location.path, []).append(edit)
    changed = {}
    for path, file_edits in edits.items():
        file = parsed_file(manifest.tree, path)
        data = mutated_bytes(apply_edits(file, [defence_import_edit(file, package), *file_edits]))
        if without_defence_lines(data) != file.data:
            raise MutatorError(
                "removing the lines of the defences does not restore the original",
                where=file.full_path,
                remedy="place the observation or the actuation at another statement",
            )
        changed[path] = data
    return changed


def _observation_call(observation: Observation) -> str:
    pairs = ", ".join(f"{name}={_own_hypot(text)}" for name, text in observation.name_expression_pairs)
    return f"{DEFENCE_MODULE_NAME}.observe({pairs})"


def _command_call(actuation: Actuation, defences: Sequence[Defence]) -> str:
    used = {sense.value for defence in defences for sense in defence.senses if not sense.is_truth}
    pairs = [(command.name, command.text) for command in actuation.commands]
    pairs += [(sense.name, sense.text) for sense in actuation.senses if sense.name in used]
    arguments = ", ".join(f"{name}={_own_hypot(text)}" for name, text in pairs)
    targets = "".join(f"{command.text}, " for command in actuation.commands).strip()
    return f"({targets}) = {DEFENCE_MODULE_NAME}.command({arguments})"


def _own_hypot(text: str) -> str:
    """Return an expression that uses the defences' `hypot` instead of the probe's, which can be missing."""
    tree = ast.parse(text, mode="eval")
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id == PROBE_MODULE_NAME:
            node.id = DEFENCE_MODULE_NAME
    return ast.unparse(tree)


def _check_commands_are_known(
    file: ParsedFile,
    anchor: ResolvedAnchor,
    actuation: Actuation,
    edit: LineEdit,
    manifest: TargetManifest,
) -> None:
    for command in actuation.commands:
        if normalize_identifier(base_variable(command.text)) not in anchor.names_used_in_function:
            raise manifest.source.error(
                ("actuation", "commands", command.name, "is"),
                f"'{command.text}' is not known in {actuation.location.function}",
                expected=f"a name used there: {', '.join(sorted(anchor.names_used_in_function))}",
            )
    inserted = range(edit.line_index + 1, edit.line_index + 2)
    moved = next(rescoped_names(file.data, mutated_bytes(apply_edits(file, [edit])), inserted), None)
    # the module that runs the defences is imported by another line
    if moved and moved.name != DEFENCE_MODULE_NAME:
        raise manifest.source.error(
            ("actuation", "commands"),
            f"assigning '{moved.name}' would make it {moved.scope_after} in {moved.function_or_class}",
            expected="variables that the function sets itself, attributes or items",
        )


def _check_names_are_free(manifest: TargetManifest, defences: Sequence[Defence]) -> None:
    """Refuse a tree with files, modules or lines that look like those of defences."""
    tree, package = manifest.tree, manifest.probe_package
    stems = [
        module_path(package, name).removesuffix("py")
        for name in (DEFENCE_MODULE_NAME, *defence_module_names(defences))
    ]
    for path, data in tree.files.items():
        if any(path.startswith((stem, f"{stem[:-1]}/")) for stem in stems):
            raise MutatorError(
                f"the target has a file {path}",
                where=manifest.root,
                expected="no file of this name, because defences use it",
                remedy="rename the target's file, or point the manifest at the original tree",
            )
        if path.endswith(".py") and b"# fd:" in data:
            line = next((i for i, text in enumerate(data.splitlines(), 1) if defence_tag_of(text)), None)
            if line:
                raise MutatorError(
                    "the line ends in a `# fd:` tag, as lines of defences do",
                    where=path_below(tree.root, path),
                    line=line,
                    expected="a tree without defences",
                    remedy="point the manifest at the original tree, or change the text",
                )
    for location in (manifest.observation.location, manifest.actuation and manifest.actuation.location):
        if location and DEFENCE_MODULE_NAME.encode() in tree.files.get(location.path, b""):
            _check_module_name_is_free(parsed_file(tree, location.path))


def _check_module_name_is_free(file: ParsedFile) -> None:
    for node in ast.walk(file.syntax_tree):
        names = (getattr(node, name, None) for name in ("id", "arg", "name", "asname"))
        if DEFENCE_MODULE_NAME in names:
            raise MutatorError(
                f"the target uses the name `{DEFENCE_MODULE_NAME}`",
                where=file.full_path,
                line=getattr(node, "lineno", None),
                expected="no variable of this name, because lines of defences use it",
                remedy="rename the variable",
            )
