"""Read the defences of a library, `fault_library/defences/<name>.yaml`."""

import keyword
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import Field

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.defences.defence import Defence, Kind, Parameter, Role, Sense
from mutator.defences.defence_models import load_defence_model
from mutator.targets.observation_yaml import ValueModel
from mutator.targets.observed_values import ObservedValue
from mutator.triggers.conditions import RESERVED_NAMES, canonical_condition, canonical_formula, names_in

SCHEMA = "defence/1"
_RESERVED_NAMES = (*RESERVED_NAMES, "math", "values", "senses", "is_active")


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

    value: float = Field(allow_inf_nan=False, strict=False, description="The number.")
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
    model: str = Field(description="Its model, a file `templates/defences/<model>.py`.")
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
    commands: list[str] = Field(
        min_length=1, description="The manifest's commands that it may change; another one is an error."
    )
    priority: float = Field(
        0.0,
        allow_inf_nan=False,
        strict=False,
        description="Of several defences, the one of the highest priority acts last, so it decides.",
    )


def load_defence(path: Path, templates: Path) -> Defence:
    """Read one defence and its model. `check_defence_fits` does the checks that need a target."""
    model, source = load_yaml_model(path, DefenceModel, SCHEMA)
    if model.name != path.stem or not (model.name.isidentifier() and model.name.isascii()):
        raise source.error(
            ("name",),
            f"'{model.name}'",
            expected=f"'{path.stem}', the name of the file, of letters, digits and _",
        )
    _check_names(model, source)
    senses = tuple(_build_sense(name, sense, source) for name, sense in model.senses.items())
    names = [*model.senses, *model.parameters]
    derived = _build_derived(model, source, names)
    with source.locating_errors(("acts_when",)):
        acts_when = canonical_condition(model.acts_when, variables=names)
    with source.locating_errors(("lets_go_when",)):
        lets_go_when = canonical_condition(model.lets_go_when or f"not ({acts_when})", variables=names)
    defence_model = load_defence_model(templates, model.model, source)
    model_parameters = defence_model.choose_parameters([*model.parameters], model.commands, source)
    if defence_model.bounds:
        _check_bounds(model, model_parameters, source)
    texts = (acts_when, lets_go_when, *(value.text for value in derived))
    used = {*model_parameters, *(name for text in texts for name in names_in(text))}
    if unused := next((name for name in model.parameters if name not in used), None):
        raise source.error(
            ("parameters", unused),
            f"nothing uses '{unused}'",
            expected=f"a parameter of the model ({defence_model.describe_parameters(model.commands)}), of a "
            "condition or of a formula",
            remedy="correct its name, or remove it",
        )
    return Defence(
        name=model.name,
        about=model.about,
        role=Role(model.role),
        kind=Kind(model.kind),
        reference=model.source,
        model=model.model,
        model_path=defence_model.path,
        model_code=defence_model.code,
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
        commands=tuple(dict.fromkeys(model.commands)),
        priority=model.priority,
        digest=digest([digest(read_bounded(path)), digest(defence_model.code)]),
        source=source,
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
