"""The runtime of defences, the file `_fd` of a defended tree: its path and its source."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from mutator.config.location_syntax import DEFENCE_MODULE_NAME, defence_module_name
from mutator.defences.defence import Defence, Sense
from mutator.errors import MutatorError
from mutator.mutants.template_rendering import render_template
from mutator.targets.actuation import Actuation
from mutator.targets.manifest import DEFENCE_REPORT_FILE, TargetManifest
from mutator.triggers.conditions import TIME, to_python_source


def module_path(package: str | None, name: str) -> str:
    """Return the path of a defence's module in a tree; without a package, it is at the tree's root."""
    return f"{package}/{name}.py" if package else f"{name}.py"


def defence_module_names(defences: Sequence[Defence]) -> list[str]:
    return [defence_module_name(defence.name) for defence in defences]


def defence_report_request(manifest: TargetManifest) -> tuple[str, str] | None:
    """Return the module that reports on the defences in a target's tree, and the file for its report."""
    if not manifest.defences:
        return None
    package = manifest.probe_package
    module = f"{package}.{DEFENCE_MODULE_NAME}" if package else DEFENCE_MODULE_NAME
    return module, DEFENCE_REPORT_FILE


def render_runtime(
    manifest: TargetManifest, actuation: Actuation, defences: Sequence[Defence], template: str, where: Path
) -> str:
    """Render the runtime for these defences, in the order in which they act."""
    observation = manifest.observation
    used = {sense.value for defence in defences for sense in defence.senses}
    truth = [name for name in observation.variables if name in used and name != TIME]
    controller = [sense.name for sense in actuation.senses if sense.name in used]
    index_by_name = {(True, name): i for i, name in enumerate(truth)}
    index_by_name |= {(False, name): len(truth) + i for i, name in enumerate(controller)}
    needed = observation.names_with_inputs(truth)
    names = {
        "package": manifest.probe_package,
        "counted": observation.time is None,
        "step_s": float(manifest.step_s),
        "observed": [name for name, _ in observation.name_expression_pairs],
        "values": [value.name for value in observation.values if value.name in needed],
        "derived": [
            (value.name, to_python_source(value.text, is_formula=True))
            for value in observation.derived
            if value.name in needed
        ],
        "truth": truth,
        "controller": controller,
        "commands": [
            {"name": c.name, "lowest": c.lowest, "highest": c.highest, "tolerance": c.tolerance}
            for c in actuation.commands
        ],
        "defences": [_settings_of(defence, index_by_name) for defence in defences],
    }
    text = render_template(template, names, where)
    try:
        compile(text, str(where), "exec", dont_inherit=True)
    except SyntaxError as error:
        raise MutatorError(
            f"the runtime of the defences does not compile: {error.msg}",
            where=where,
            remedy="restore the template",
        ) from None
    return text


def _settings_of(defence: Defence, index_by_name: Mapping[tuple[bool, str], int]) -> dict[str, object]:
    return {
        "module": defence_module_name(defence.name),
        "decision": _decision_source(defence, index_by_name),
        "constructor": _constructor_source(defence, index_by_name),
    }


def _decision_source(defence: Defence, index_by_name: Mapping[tuple[bool, str], int]) -> str:
    """Return the function that tells whether the condition holds for the next change of a defence's state,
    and what is sensed.
    """
    steps = [
        (sense.name, _reading_source(sense, number, index_by_name[sense.is_truth, sense.value]))
        for number, sense in enumerate(defence.senses)
    ]
    numbers = {parameter.name: parameter.value for parameter in defence.parameters}
    steps += [
        (value.name, to_python_source(value.text, numbers, is_formula=True)) for value in defence.derived
    ]
    acts, lets_go = (to_python_source(text, numbers) for text in (defence.acts_when, defence.lets_go_when))
    sensed = ", ".join(f'"{name}": {name}' for name, _ in steps)
    lines = [
        f"def _decide_{defence.name}(t, values, senses, is_active):",
        *(f"    {name} = {code}" for name, code in steps),
        f"    return ({lets_go}) if is_active else ({acts}), {{{sensed}}}",
    ]
    return "\n".join(lines)


def _reading_source(sense: Sense, number: int, index: int) -> str:
    return f"senses[{number}].read(t, values)" if sense.delay_s or sense.noise else f"values[{index}]"


def _constructor_source(defence: Defence, index_by_name: Mapping[tuple[bool, str], int]) -> str:
    def input_of(sense: Sense) -> tuple[int, float, float, str]:
        index = index_by_name[sense.is_truth, sense.value]
        return index, sense.delay_s, sense.noise, f"{defence.name}/{sense.name}"

    value_by_parameter = {parameter.name: parameter.value for parameter in defence.parameters}
    numbers = ", ".join(f"{name}={value_by_parameter[name]!r}" for name in defence.model_parameters)
    arguments = (
        repr(defence.name),
        f"{defence_module_name(defence.name)}.Model({numbers})",
        f"_decide_{defence.name}",
        repr([input_of(sense) for sense in defence.senses]),
        repr(defence.commands),
        repr(defence.acts_after_s),
        repr(defence.lets_go_after_s),
    )
    return f"_Defence({', '.join(arguments)})"
