"""Read fault models: the YAML and the template of each."""

from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Literal

from pydantic import Field

from mutator._common import hashing
from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_path_inside
from mutator.config import units
from mutator.config.phrases_yaml import build_phrase
from mutator.config.yaml_files import MOST_YAML_BYTES, StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.faults import probe_template_parts
from mutator.faults.fault_models import (
    TEMPLATE_FOLDER_GLOBS,
    UNIT_OF_CHANGED_VARIABLE,
    FaultModel,
    FaultModelExample,
    FaultModels,
    ParamSchema,
    SnippetKind,
    TemplateNeed,
    UnnamedParamSchema,
)
from mutator.faults.injection_model import InjectionModel
from mutator.faults.phrase_holes import model_holes
from mutator.faults.probe_template_parts import ProbeTemplates

SCHEMA = "fault_model/1"
_TEMPLATE_VARIABLES = (
    "fi",
    "original",
    "left",
    "right",
    "called",
    "arguments",
    "statement",
    "next_statement",
)


_CHANGED_VARIABLE_PARAM = ParamSchema(
    name="target",
    type="variable",
    about="the variable to change, if it is not the one that the anchor names",
)


class _ExampleModel(StrictModel, title="An example"):
    """Each example is shown on the page of its fault model, and `mutator check` runs it as a test."""

    about: str = Field(description="What the example shows. The page prints this after *For example,*.")
    injection: InjectionModel = Field(description="An injection, written as in a spec.")
    before: str = Field(description="The source before the injection.")
    after: str = Field(description="The source after the injection, tagged `example`.")


class FaultModelModel(StrictModel, title="The file"):
    """Name, parameters and examples of a fault model. The template is in `NAME.py.j2`, next to this file."""

    name: str = Field(description="The name. It must match the file name without `.yaml`.")
    kind: Literal["insert", "guard", "value"] = Field(
        description="`insert`: adds lines before or after the statement. `guard`: wraps the statement. "
        "`value`: the template is one expression that uses `original`, the value of a variable or"
        " an expression."
    )
    expression: str | None = Field(
        None,
        description="For kind `insert` only: a second template, which applies the same change to the value "
        "of an expression, passed as `original`.",
    )
    about: str = Field(description="What the model does, in one sentence.")
    phrase: str | list[str] | None = Field(
        None,
        description="What an injection does, as a clause, for experiments whose spec has no phrase: `{by} is "
        "added to {changed} in {function}`. Holes: `changed` (the variable or expression), `function`, "
        "`file`, the parameters, and the numbers without their sign (`abs_by`). Of several texts, the first "
        "whose parameters are all set is used.",
    )
    raises: bool = Field(
        False,
        description="Whether the model's lines raise on purpose. If so, an exception in them is a crash of "
        "the target; otherwise it makes the mutant invalid.",
    )
    needs: Literal["call", "statement", "next_statement"] | None = Field(
        None,
        description="What the template needs in addition to its parameters. `call`: the anchored expression "
        "is a call, passed as `called` and `arguments`. `statement`: the anchored statement on "
        "one line. `next_statement`: also the statement after it; a guard then wraps both.",
    )
    params: dict[str, YamlRecord[UnnamedParamSchema]] = Field(
        default_factory=dict, description="Name -> parameter."
    )
    examples: list[_ExampleModel] = Field(min_length=1, description="At least one.")


def load_fault_models(folder: Path) -> FaultModels:
    """Load the fault models of a templates folder, from memory unless a file has changed."""
    paths = [path for kind in TEMPLATE_FOLDER_GLOBS for path in sorted(folder.glob(kind))]
    for path in paths:
        if path.is_symlink():
            checked_path_inside(folder, path)
    try:
        contents = tuple((path, read_bounded(path, MOST_YAML_BYTES)) for path in paths)
    except OSError:
        return _load_all(folder)  # the error that names the file
    return _load_cached(folder, contents)


@lru_cache(maxsize=4)  # a process rarely uses more folders
def _load_cached(folder: Path, contents: tuple[tuple[Path, bytes], ...]) -> FaultModels:
    """Load a folder. `contents` of its files only distinguishes cached results."""
    return _load_all(folder)


def _load_all(folder: Path) -> FaultModels:
    models = {}
    for path in sorted(folder.glob("*.yaml")):
        model = _load_model(path)
        models[model.name] = model
    if not models:
        raise MutatorError("no fault model", where=folder, expected="<model>.yaml next to <model>.py.j2")
    code, settings = (_read_template(folder / name) for name in probe_template_parts.PROBE_TEMPLATE_FILES)
    probe = ProbeTemplates.from_texts(folder, code, settings)
    texts = {
        name: [model.template, model.expression_template] if model.expression_template else model.template
        for name, model in models.items()
    }
    raising = [name for name, model in models.items() if model.raises]
    digest = hashing.digest([texts, probe.whole_text, *([raising] if raising else [])])
    return FaultModels(folder=folder, models=models, probe_templates=probe, digest=digest)


def _load_model(path: Path) -> FaultModel:
    model, source = load_yaml_model(path, FaultModelModel, SCHEMA)
    if model.name != path.stem:
        raise source.error(("name",), f"'{model.name}'", expected=f"'{path.stem}', the name of the file")
    template_path, kind = path.with_suffix(".py.j2"), SnippetKind(model.kind)
    if model.expression is not None and kind is not SnippetKind.INSERT:
        raise source.error(
            ("expression",),
            f"`expression` with kind {kind.value}",
            expected="`expression` only with kind insert",
            remedy="delete `expression`",
        )
    template = _read_template(template_path)
    params = tuple(_build_param(name, param, source) for name, param in model.params.items())
    return FaultModel(
        name=model.name,
        kind=kind,
        about=model.about,
        raises=model.raises,
        needs=TemplateNeed(model.needs) if model.needs else None,
        params=(*params, _CHANGED_VARIABLE_PARAM)
        if kind is SnippetKind.VALUE and model.needs != "call"
        else params,
        examples=tuple(
            FaultModelExample(
                about=example.about,
                injection=example.injection.injection_spec(source, ("examples", i, "injection")),
                before=example.before,
                after=example.after,
                line=source.line_of(("examples", i)),
            )
            for i, example in enumerate(model.examples)
        ),
        template=template,
        expression_template=template.removesuffix("\n") if kind is SnippetKind.VALUE else model.expression,
        source=source,
        template_path=template_path,
        phrase=build_phrase(model.phrase, model_holes(params), source, ("phrase",)),
    )


def _build_param(name: str, param: UnnamedParamSchema, source: YamlSource) -> ParamSchema:
    keys = ("params", name)
    if not name.isidentifier() or units.split_key_at_unit(name)[1]:
        raise source.error(keys, f"parameter '{name}'", expected="an identifier without a unit suffix")
    if name in _TEMPLATE_VARIABLES:
        raise source.error(
            keys,
            f"parameter '{name}'",
            expected="a name other than these, which templates already use: "
            + ", ".join(_TEMPLATE_VARIABLES),
            remedy="rename the parameter",
        )
    if param.unit not in (None, UNIT_OF_CHANGED_VARIABLE, *units.UNITS):
        raise source.error(
            (*keys, "unit"), f"'{param.unit}'", expected=f"target or one of {units.UNIT_SUFFIXES_TEXT}"
        )
    if (param.type == "choice") != bool(param.choices):
        state = "no `choices`" if param.type == "choice" else "`choices`"
        raise source.error(
            keys,
            f"parameter '{name}' of type {param.type} has {state}",
            expected="`choices` for a choice, and only for a choice",
        )
    return ParamSchema(name=name, **asdict(param))


def _read_template(path: Path) -> str:
    try:
        return read_bounded(path, MOST_YAML_BYTES).decode()
    except (OSError, UnicodeDecodeError) as error:
        raise MutatorError(
            f"cannot be read ({error})", where=path, remedy="put the template next to its YAML file, as UTF-8"
        ) from None
