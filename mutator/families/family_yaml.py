"""Reads family files."""

import math
from decimal import Decimal
from pathlib import Path
from statistics import NormalDist
from typing import Annotated

from pydantic import Discriminator, Field, Tag, model_validator

from mutator._common.message_text import describe_choices
from mutator.config.units import split_key_at_unit
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.errors import MutatorError
from mutator.families.family import Family, Frequency
from mutator.families.parameters import Parameter, Shape, probabilities_of_shape
from mutator.families.scenario_sampling import SAMPLING_METHODS
from mutator.triggers.conditions import RESERVED_NAMES, canonical_condition

FAMILY_SCHEMA = "family/1"
_MOST_VALUES = 100_000  # of a parameter; more mean a mistyped step
_Number = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]
_NUMBER_OR_WHOLE = Annotated[int, Field(ge=-(10**9), le=10**9)] | _Number


class NormalModel(StrictModel, title="A normal distribution"):
    """A normal distribution, cut off at the ends of the range."""

    mean: _Number = Field(description="The mean, in the parameter's unit.")
    sd: _Number = Field(gt=0, description="The standard deviation, in the parameter's unit.")


class LogNormalModel(StrictModel, title="A log-normal distribution"):
    """A distribution of positive values whose logarithm is normal, cut off at the ends of the range."""

    median: _Number = Field(gt=0, description="The median, in the parameter's unit.")
    sigma: _Number = Field(gt=0, description="The standard deviation of the natural logarithm.")


class RangeModel(StrictModel, title="A range"):
    """Values at equal distances, both ends included. Give at most one distribution; without one, all values
    are equally likely.
    """

    from_: _NUMBER_OR_WHOLE = Field(alias="from", description="The least value.")
    to: _NUMBER_OR_WHOLE = Field(description="The greatest value, a whole number of steps above the least.")
    step: _NUMBER_OR_WHOLE = Field(gt=0, description="The distance from one value to the next.")
    normal: NormalModel | None = Field(None, description="Draw values from a normal distribution.")
    log_normal: LogNormalModel | None = Field(None, description="Draw values from a log-normal distribution.")

    @model_validator(mode="after")
    def _check(self) -> "RangeModel":
        self.values()
        if self.normal and self.log_normal:
            raise ValueError("either `normal` or `log_normal`")
        if shape := self.shape():
            probabilities_of_shape(shape, self.values(), self.step)
        return self

    def values(self) -> list[int | float]:
        """Return all values, calculated in decimals: 3 * 0.1 is 0.3. ValueError if the range is not valid."""
        first, last, step = (Decimal(str(number)) for number in (self.from_, self.to, self.step))
        count = (last - first) / step
        if count < 0 or count != count.to_integral_value():
            raise ValueError("`to` a whole number of steps above `from`")
        if count >= _MOST_VALUES:
            raise ValueError(f"at most {_MOST_VALUES} values")
        number_type = int if all(isinstance(n, int) for n in (self.from_, self.to, self.step)) else float
        return [number_type(first + i * step) for i in range(int(count) + 1)]

    def shape(self) -> Shape | None:
        if self.normal:
            return Shape(normal=NormalDist(self.normal.mean, self.normal.sd))
        if self.log_normal:
            logarithm = NormalDist(math.log(self.log_normal.median), self.log_normal.sigma)
            return Shape(normal=logarithm, is_logarithmic=True)
        return None


class FrequencyPartModel(StrictModel, title="A part of a frequency"):
    """The share of the road's situations in which the parameter lies in a range, the lower end included."""

    from_: _Number = Field(alias="from", description="The lower end, included.")
    to: _Number = Field(description="The upper end, included only if it is that of the last part.")
    weight: _Number = Field(ge=0, description="The share, relative to the other parts.")


class FrequencyModel(StrictModel, title="A frequency"):
    """How often values occur on the road. Tables use it to weigh scenarios; runs never do. Values of
    different parameters are taken to be independent.
    """

    source: str = Field(min_length=1, description="Where these numbers come from.")
    of: dict[str, list[FrequencyPartModel]] = Field(
        min_length=1, description="Key of a parameter -> the parts of its range. They must cover all values."
    )


def _kind_of_values(values: object) -> str:
    if not isinstance(values, list):
        return "range"
    return "texts" if values and isinstance(values[0], str) else "numbers"


_Values = Annotated[
    Annotated[RangeModel, Tag("range")]
    | Annotated[list[_NUMBER_OR_WHOLE], Tag("numbers")]
    | Annotated[list[str], Tag("texts")],
    Discriminator(_kind_of_values),
]


class FamilyModel(StrictModel, title="families/*.yaml"):
    """A scenario with parameters. Each choice of their values gives a concrete scenario."""

    name: str = Field(
        pattern=r"^[a-z][a-z0-9_]*$", description="The name. It must match the file name without `.yaml`."
    )
    title: str = Field(min_length=1, description="What happens, in one line.")
    source: str = Field(min_length=1, description="Where the numbers come from: a standard, a paper, you.")
    parameters: dict[str, _Values] = Field(
        min_length=1,
        description="Name and unit -> the possible values: a list of numbers or of texts, or a range. "
        "`gap_m: [10, 20]`, `ego_kph: {from: 10, to: 80, step: 5}`.",
    )
    constraints: list[str] = Field(
        default_factory=list,
        description="Conditions that each scenario meets, over the parameters in any unit of theirs: "
        "`gap_m >= ego_mps * 0.5`. Allowed is what conditions of triggers allow.",
    )
    sampling: str = Field(
        "grid",
        json_schema_extra={"enum": list(SAMPLING_METHODS)},
        description="How scenarios are drawn, unless a campaign says so: `grid` (all combinations, or an "
        "even part of them), `random`, `latin_hypercube` or `sobol`.",
    )
    frequency: FrequencyModel | None = Field(None, description="How often values occur on the road.")
    template: str = Field(
        min_length=1,
        description="The scenario in the target's own format, with `{{ ego_kph }}` for a value. Each is "
        "there in all units of its dimension: `{{ ego_mps }}`. `{{ label }}` has all values as text.",
    )


def load_family(path: Path) -> Family:
    """Read a family file strictly; any mistake raises MutatorError with file and line."""
    model, source = load_yaml_model(path, FamilyModel, FAMILY_SCHEMA)
    if model.name != path.stem:
        raise source.error(
            ("name",), f"'{model.name}'", expected=f"'{path.stem}', as the file", remedy="rename one of them"
        )
    if model.sampling not in SAMPLING_METHODS:
        raise source.error(
            ("sampling",),
            f"'{model.sampling}'",
            expected=describe_choices(SAMPLING_METHODS),
            remedy="correct the name",
        )
    parameters = tuple(_build_parameter(key, values, source) for key, values in model.parameters.items())
    _check_names(parameters, source)
    family = Family(
        name=model.name,
        title=model.title,
        source=model.source.strip(),
        path=path,
        parameters=parameters,
        constraints=_canonical_constraints(model.constraints, parameters, source),
        sampling=model.sampling,
        frequency=_build_frequency(model.frequency, parameters, source),
        template=model.template,
        yaml_source=source,
    )
    family.concrete([parameter.values[0] for parameter in parameters])  # finds mistakes of the template
    return family


def _build_parameter(
    key: str, values: RangeModel | list[int | float] | list[str], source: YamlSource
) -> Parameter:
    name, unit = split_key_at_unit(key)
    keys: KeyPath = ("parameters", key)
    if not name.isidentifier() or not name.islower() or name in (*RESERVED_NAMES, "family", "label"):
        raise source.error(
            keys,
            f"'{key}'",
            expected="a name in lowercase letters, digits and _, and the unit: `gap_m`",
            remedy="rename it",
        )
    if isinstance(values, RangeModel):
        numbers, shape = values.values(), values.shape()
        probabilities = probabilities_of_shape(shape, numbers, values.step) if shape else None
        return Parameter(
            name=name, key=key, unit=unit, values=numbers, probabilities=probabilities, is_range=True
        )
    if not values:
        raise source.error(
            keys, "no value", expected="at least one", remedy="list the values, or give a range"
        )
    for i, value in enumerate(values):
        if value in values[:i]:
            raise source.error((*keys, i), f"{value} is listed twice", remedy="remove one of the two")
        if isinstance(value, str) and (unit or not value.replace("_", "").isalnum()):
            raise source.error(
                (*keys, i),
                f"'{value}'",
                expected="letters, digits and _, and a parameter without a unit",
                remedy="rename it",
            )
    return Parameter(name=name, key=key, unit=unit, values=tuple(values))


def _check_names(parameters: tuple[Parameter, ...], source: YamlSource) -> None:
    key_by_name: dict[str, str] = {}
    for parameter in parameters:
        for name in (parameter.name, *parameter.names_in_templates):
            other = key_by_name.setdefault(name, parameter.key)
            if other != parameter.key:
                raise source.error(
                    ("parameters", parameter.key),
                    f"'{parameter.key}' has the name `{name}` of '{other}'",
                    expected="names of their own",
                    remedy="rename one of them",
                )


def _canonical_constraints(
    constraints: list[str], parameters: tuple[Parameter, ...], source: YamlSource
) -> tuple[str, ...]:
    names = [name for p in parameters if p.is_number for name in p.names_in_templates]
    canonical = []
    for i, text in enumerate(constraints):
        with source.locating_errors(("constraints", i)):
            canonical.append(canonical_condition(text, variables=names))
    return tuple(canonical)


def _build_frequency(
    model: FrequencyModel | None, parameters: tuple[Parameter, ...], source: YamlSource
) -> Frequency | None:
    if model is None:
        return None
    parameter_by_key = {parameter.key: parameter for parameter in parameters if parameter.is_number}
    probabilities = {}
    for key, parts in model.of.items():
        keys: KeyPath = ("frequency", "of", key)
        if key not in parameter_by_key:
            raise source.error(
                keys,
                f"'{key}'",
                expected=describe_choices(parameter_by_key),
                remedy="name a parameter that has numbers",
            )
        parameter = parameter_by_key[key]
        with source.locating_errors(keys):
            probabilities[parameter.name] = _probabilities_of_parts(parts, parameter)
    return Frequency(source=model.source.strip(), probabilities=probabilities)


def _probabilities_of_parts(parts: list[FrequencyPartModel], parameter: Parameter) -> tuple[float, ...]:
    """Return how often each value occurs: the weight of its part, shared by the values in it."""
    numbers = [float(value) for value in parameter.values]
    part_of_value = []
    for number in numbers:
        hits = [
            i
            for i, part in enumerate(parts)
            if part.from_ <= number < part.to or (i == len(parts) - 1 and number == part.to)
        ]
        if len(hits) != 1:
            raise MutatorError(
                f"{len(hits)} parts with {parameter.describe(number)}",
                expected="one part for each value",
                remedy="let each part begin where the one before ends",
            )
        part_of_value += hits
    total = sum(part.weight for i, part in enumerate(parts) if i in part_of_value)
    if not total:
        raise MutatorError("no weight", expected="a weight above 0", remedy="correct the weights")
    return tuple(parts[i].weight / total / part_of_value.count(i) for i in part_of_value)
