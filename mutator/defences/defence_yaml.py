"""Read the defences of a library, `fault_library/defences/<name>.yaml`."""

import keyword
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import MOST_NAME_BYTES
from mutator._common.hashing import digest
from mutator._common.message_text import shortened_repr, spelling_suggestion
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.units import UNITS
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.defences.defence import Defence, Kind, Parameter, Role, Sense
from mutator.defences.defence_models import DefenceModelFile, load_defence_model
from mutator.errors import MutatorError
from mutator.targets.observation_yaml import ValueModel
from mutator.targets.observed_values import ObservedValue
from mutator.triggers.conditions import (
    RESERVED_NAMES,
    canonical_condition,
    canonical_formula,
    evaluate_condition,
    names_in,
)

SCHEMA = "defence/1"
_NO_DEFENCE = "none"  # in the sets of a campaign
MOST_NAME_LENGTH = MOST_NAME_BYTES - len("_fd_.py")  # a copy of its model is a file of this name
_TIME_UNITS = frozenset(unit.symbol for unit in UNITS.values() if unit.dimension == "time")
_RESERVED_NAMES = (*RESERVED_NAMES, "math", "values", "senses", "is_active")


def _checked_commands(names: list[str]) -> list[str]:
    if not names:
        raise ValueError("at least one command of the manifest")
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ValueError(f"each command once, but '{twice}' is there twice")
    return names


class SenseModel(StrictModel, title="A sensed value"):
    """Give either `truth` or `controller`."""

    truth: str | None = Field(
        None, description="An observed or derived value of the manifest: a sensor that no fault reaches."
    )
    controller: str | None = Field(
        None,
        description="One of the manifest's `actuation.senses`: faults reach it as they do the controller.",
    )
    delay_s: float = Field(0.0, ge=0.0, allow_inf_nan=False, description="How late the value comes, in s.")
    noise: float = Field(
        0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="Standard deviation of normal noise, in the value's unit. It is the same in each run.",
    )


class ParameterModel(StrictModel, title="A parameter"):
    """A number for conditions, formulas and the model."""

    value: float = Field(allow_inf_nan=False, description="The number.")
    unit: UnitSymbol = Field(description="The unit; `-` for none.")
    about: str = Field("", description="What the number means, and its source.")


class DefenceModel(StrictModel, title="The file"):
    """Something that acts against a hazard: a safety mechanism, an external measure or a driver."""

    name: str = Field(description="The name, which is the file's name, too.")
    about: str = Field(description="What it does.")
    role: Literal["safety_mechanism", "external_measure", "driver"] = Field(
        description="Whether it is part of the system (`safety_mechanism`), outside of it "
        "(`external_measure`), or a `driver`, as ISO 26262-1 distinguishes."
    )
    kind: Literal["driver", "emergency_braking", "limit", "monitor", "other"] = Field(
        description="What it does: `driver`, `emergency_braking`, `limit`, `monitor` or `other`."
    )
    source: str = Field("", description="Where its numbers come from.")
    model: str = Field(
        description="Its model, a file `templates/defences/<model>.py`. What its source may use is checked, "
        "which keeps honest mistakes out; it is no sandbox: read a model before you run it."
    )
    senses: dict[str, SenseModel] = Field(
        default_factory=dict, description="Name -> where a value comes from."
    )
    derived: dict[str, ValueModel] = Field(
        default_factory=dict,
        description="Name -> a formula over sensed values, parameters and the derived values before it.",
    )
    parameters: dict[str, ParameterModel] = Field(
        default_factory=dict,
        description="Name -> a number. The model gets those that it declares; a model that takes any "
        "(`**bounds`) also gets those named `<word>_<command>`, with a word of its `BOUNDS`.",
    )
    acts_when: str = Field(
        "True", description="The condition under which it becomes active. Without it, it always is."
    )
    acts_after_s: float = Field(
        0.0, ge=0.0, allow_inf_nan=False, description="How long that condition must have held, in s."
    )
    lets_go_when: str | None = Field(
        None, description="The condition under which it ends. Default: `acts_when` does not hold."
    )
    lets_go_after_s: float = Field(
        0.0, ge=0.0, allow_inf_nan=False, description="How long that condition must have held, in s."
    )
    commands: Annotated[list[str], AfterValidator(_checked_commands)] = Field(
        description="The manifest's commands that it may change; another one is an error.",
        json_schema_extra={"minItems": 1, "uniqueItems": True},
    )
    priority: float = Field(
        0.0,
        allow_inf_nan=False,
        description="Of several defences, the one of the highest priority acts last, so it decides.",
    )


def check_file_names(library: Path) -> None:
    """Raise MutatorError if a library's defence has a name that is too long for files and folders."""
    for path in sorted((library / "defences").glob("*.yaml")):
        if len(path.stem) > MOST_NAME_LENGTH:
            raise MutatorError(
                f"a name of {len(path.stem)} characters",
                where=path,
                expected=f"at most {MOST_NAME_LENGTH}, because files and folders get the name of a defence",
                remedy="rename the file, and shorten its key `name`",
            )


def load_defence(path: Path, templates: Path) -> Defence:
    """Read one defence and its model. `checked_actuation` does the checks that need a target."""
    model, source = load_yaml_model(path, DefenceModel, SCHEMA)
    _check_defence_name(model.name, source)
    _check_names(model, source)
    senses = tuple(_build_sense(name, sense, source) for name, sense in model.senses.items())
    names = [*model.senses, *model.parameters]
    derived = _build_derived(model, source, names)
    acts_when = _checked_condition(model.acts_when, "acts_when", names, source)
    lets_go_when = f"not ({acts_when})" if model.lets_go_when is None else model.lets_go_when
    lets_go_when = _checked_condition(lets_go_when, "lets_go_when", names, source)
    if not names_in(acts_when) and not evaluate_condition(acts_when, {}):
        raise source.error(
            ("acts_when",),
            f"'{acts_when}', which never holds",
            expected="a condition over senses, derived values and parameters",
            remedy="correct it, or remove the defence",
        )
    defence_model = load_defence_model(templates, model.model, source)
    model_parameters = defence_model.choose_parameters([*model.parameters], model.commands, source)
    _check_times(model, defence_model.parameters, source)
    if defence_model.bounds:
        _check_bounds(model, model_parameters, source)
    texts = (acts_when, lets_go_when, *(value.text for value in derived))
    _check_sensed_names(model, defence_model, texts, source)
    return Defence(
        name=model.name,
        about=model.about,
        role=Role(model.role),
        kind=Kind(model.kind),
        reference=model.source,
        model=model.model,
        model_path=defence_model.path,
        model_code=defence_model.code,
        model_file=defence_model,
        senses=senses,
        derived=derived,
        parameters=tuple(
            Parameter(name=name, value=float(p.value), unit=p.unit, about=p.about)
            for name, p in model.parameters.items()
        ),
        model_parameters=model_parameters,
        acts_when=acts_when,
        acts_after_s=model.acts_after_s,
        lets_go_when=lets_go_when,
        lets_go_after_s=model.lets_go_after_s,
        commands=tuple(model.commands),
        priority=model.priority,
        digest=digest([digest(read_bounded(path)), digest(defence_model.code)]),
        source=source,
    )


def _check_defence_name(name: str, source: YamlSource) -> None:
    stem = source.path.stem
    good = name.isidentifier() and name.isascii()
    if good and name == stem and name != _NO_DEFENCE and len(name) <= MOST_NAME_LENGTH:
        return
    if name != stem:
        expected, remedy = f"'{stem}', the name of the file", "write the name of the file, or rename the file"
    elif name == _NO_DEFENCE:
        expected = f"another name: in a campaign, `{_NO_DEFENCE}` is the run without defences"
        remedy = "rename the defence and its file"
    elif good:
        expected = f"at most {MOST_NAME_LENGTH} characters, because files and folders get this name"
        remedy = "shorten the name, and that of the file"
    else:
        expected = "a name of the letters a to z and A to Z, digits and _, which does not begin with a digit"
        remedy = "rename the defence and its file"
    raise source.error(("name",), shortened_repr(name), expected=expected, remedy=remedy)


def _checked_condition(text: str, key: str, names: list[str], source: YamlSource) -> str:
    if not text.strip():
        raise source.error(
            (key,), "an empty text", expected="a condition", remedy="write one, or remove the key"
        )
    with source.locating_errors((key,)):
        return canonical_condition(text, variables=names)


def _check_times(model: DefenceModel, names: Iterable[str], source: YamlSource) -> None:
    """Refuse negative times of the model, such as a time to react."""
    for name, parameter in model.parameters.items():
        if name in names and parameter.unit in _TIME_UNITS and parameter.value < 0:
            raise source.error(
                ("parameters", name, "value"),
                f"{parameter.value:g} {parameter.unit} for '{name}'",
                expected="a time, at least 0",
                remedy="remove the sign",
            )


def _check_sensed_names(
    model: DefenceModel, defence_model: DefenceModelFile, texts: Iterable[str], source: YamlSource
) -> None:
    """Refuse a defence that lacks a value which its model reads, and one with a value that nothing uses."""
    values = [("senses", name) for name in model.senses] + [("derived", name) for name in model.derived]
    names = [name for _, name in values]
    for name, line in defence_model.sensed.line_by_required_name:
        if name not in names:
            raise source.error(
                ("senses",),
                f"no sense or derived value '{name}'",
                expected=f"it, because model {model.model} reads it ({defence_model.path.name}:{line})",
                remedy="add it, or name another model" + spelling_suggestion(name, names),
            )
    if defence_model.sensed.reads_others:
        return
    used = {*defence_model.sensed.names, *(name for text in texts for name in names_in(text))}
    for key, name in values:
        if name not in used:
            raise source.error(
                (key, name),
                f"nothing uses '{name}'",
                expected="a value of a condition, of a formula or of the model",
                remedy="correct its name, or remove it",
            )


def _check_names(model: DefenceModel, source: YamlSource) -> None:
    sections: tuple[tuple[str, Iterable[str]], ...] = (
        ("senses", model.senses),
        ("parameters", model.parameters),
        ("derived", model.derived),
    )
    used_names = set[str]()
    for key, names in sections:
        for name in names:
            good = name.isidentifier() and not keyword.iskeyword(name) and not name.startswith("_")
            if not good or name in _RESERVED_NAMES or name in used_names:
                raise source.error(
                    (key, name),
                    f"'{name}'",
                    expected=f"a unique name of letters, digits and _, none of {', '.join(_RESERVED_NAMES)}",
                    remedy="rename it",
                )
            used_names.add(name)


def _check_bounds(model: DefenceModel, model_parameters: Iterable[str], source: YamlSource) -> None:
    """Refuse bounds of a command that cross, and a negative rate."""
    value_by_name = {name: model.parameters[name].value for name in model_parameters}
    for command in model.commands:
        lowest, highest, rate = (f"{word}_{command}" for word in ("lowest", "highest", "rate"))
        low, high = value_by_name.get(lowest, -math.inf), value_by_name.get(highest, math.inf)
        if low > high:
            raise source.error(
                ("parameters", lowest, "value"),
                f"{low:g}",
                expected=f"at most `{highest}`, {high:g}",
                remedy="swap or correct them",
            )
        if value_by_name.get(rate, 0.0) < 0:
            raise source.error(
                ("parameters", rate, "value"),
                f"{value_by_name[rate]:g}",
                expected="a largest change per second, at least 0",
                remedy="remove the sign",
            )


def _build_sense(name: str, model: SenseModel, source: YamlSource) -> Sense:
    if (model.truth is None) == (model.controller is None):
        raise source.error(
            ("senses", name),
            "neither `truth` nor `controller`" if model.truth is None else "both `truth` and `controller`",
            expected="one of them",
            remedy="say where the value comes from",
        )
    return Sense(
        name=name,
        is_truth=model.truth is not None,
        value=model.truth or model.controller or "",
        delay_s=model.delay_s,
        noise=model.noise,
    )


def _build_derived(model: DefenceModel, source: YamlSource, names: list[str]) -> tuple[ObservedValue, ...]:
    """Return the derived values, and append their names to `names`."""
    values = []
    for name, value in model.derived.items():
        with source.locating_errors(("derived", name, "is")):
            text = canonical_formula(value.is_, names)
        values.append(ObservedValue(name=name, text=text, unit=value.unit, about=value.about))
        names.append(name)
    return tuple(values)
