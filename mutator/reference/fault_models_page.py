"""Generate the page of the fault models from their templates."""

import difflib
from collections.abc import Iterator

from mutator._common.table_rendering import TextTable
from mutator.faults import fault_model_files
from mutator.faults.fault_models import (
    UNIT_OF_CHANGED_VARIABLE,
    FaultModel,
    FaultModelExample,
    ParamSchema,
    SnippetKind,
)
from mutator.reference.yaml_key_tables import generated_page_head, model_sections
from mutator.workspace import Workspace

_INTRO = """\
A fault model defines what a fault does to a statement. It consists of two files in `templates/`: the template
`<name>.py.j2`, and `<name>.yaml` with its parameters and examples
([add one](../how-to/add-a-fault-model.md)). There are three kinds:

* A model that **inserts** adds lines before or after the anchored statement.
* A model that **guards** wraps the anchored statement.
* A model that **changes a value** is an expression. While the fault is active, it replaces the value of the
  anchored expression or, at a statement, of a variable.

Write a parameter in *the variable's unit* in any unit of the same dimension. Leave out `target` if the anchor
names the variable. Types of parameters:

* A *variable* is a name that the anchor's function knows.
* An *import* is a dotted name: a module of the target, then a name that the module defines. The injected
  lines import it.
* A *constant* is a number, `true`, `false`, `null` or a string.
* A *unit* is a suffix from [the table of units](fault-spec.md#units).

An integer variable stays an integer if the parameters are whole numbers.

In the examples, the model adds the lines marked with `+`. `_fi` is
[the probe](../explanation/concepts.md#checks-before-and-after-a-run): `active` checks whether the trigger
holds, and `like` converts a number to the variable's type. [Failure modes](../explanation/failure-modes.md)
shows what each model represents in standards and in the literature.
"""

_SENTENCE_BY_KIND = {
    SnippetKind.INSERT: "Inserts.",
    SnippetKind.GUARD: "Guards.",
    SnippetKind.VALUE: "Changes a value.",
}


def render_fault_models_page(workspace: Workspace) -> str:
    models = list(workspace.fault_models())
    parts = [generated_page_head("Fault models"), _INTRO]
    rows = [(f"[{model.name}](#{model.name})", _first_sentence(model.about)) for model in models]
    parts += [TextTable(heads=("model", "what it does"), rows=rows).as_markdown(escape=False), ""]
    for model in models:
        parts += _model_section(model)
    parts += [
        "## The YAML of a model\n",
        f"The first key is `schema: {fault_model_files.SCHEMA}`.\n",
        *model_sections("fault-models.md", fault_model_files.FaultModelModel, parent_level=2),
    ]
    return "\n".join(parts).rstrip() + "\n"


def _model_section(model: FaultModel) -> Iterator[str]:
    yield f"## {model.name}\n"
    does = _SENTENCE_BY_KIND[model.kind] + (
        " Its exceptions are attributed to the target." if model.raises else ""
    )
    yield f"{' '.join(model.about.split())} {does}\n"
    params = [param for param in model.params if param.type != "seed"]
    if params:
        heads = ("parameter", "type", "unit", "meaning")
        yield TextTable(heads=heads, rows=list(map(_parameter_row, params))).as_markdown(escape=False)
        yield ""
    for example in model.examples:
        yield f"For example, {example.about}:\n"
        yield f"```diff\n{_example_diff(example)}\n```\n"


def _parameter_row(param: ParamSchema) -> tuple[str, str, str, str]:
    unit = "the variable's" if param.unit == UNIT_OF_CHANGED_VARIABLE else param.unit or "-"
    low = [] if param.min is None else [f"at least {param.min:g}"]
    high = [] if param.max is None else [f"at most {param.max:g}"]
    limits = low + high + [f"`{word}`".replace("|", "\\|") for word in param.choices]
    kind = param.type + (f" ({', '.join(limits)})" if limits else "")
    about = param.about + (" (optional)" if param.optional else "")
    return f"`{param.name}`", kind, unit, about


def _example_diff(example: FaultModelExample) -> str:
    lines = difflib.ndiff(example.before.splitlines(), example.after.splitlines())
    return "\n".join((line[0] + line[2:]).rstrip() for line in lines if not line.startswith("?"))


def _first_sentence(text: str) -> str:
    return " ".join(text.split()).partition(". ")[0].rstrip(".")
