"""Hazards and metrics as data: what a run must not come to, and the numbers that tell how bad it was."""

import ast
from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal, get_args

from pydantic import Field

from mutator.config.yaml_files import Keys, Source, StrictModel
from mutator.targets.formulas import condition, formula
from mutator.triggers import stl
from mutator.triggers.conditions import parse

Aggregate = Literal["min", "max", "mean", "last", "integral", "duration", "at_end"]
_AGGREGATES = get_args(Aggregate)
_WORSE = Literal["higher", "lower"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A number for each run: an aggregate of `formula` over the steps where `where` holds, up to the end of
    the drive (the first terminal hazard, if one comes)."""

    name: str
    aggregate: Aggregate
    formula: str
    where: str = ""
    unit: str
    worse: _WORSE
    about: str
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hazard:
    """A hazard and how it is found in a trace. One without `when` and `stl` is what the record says.

    It comes where `when` has held for `for_s` seconds, or where the STL formula `stl` is violated (and all is
    seen that it looks at). `margin` is how far a step is from it, in `unit` (of `stl`, its robustness). Once
    `terminal` holds, the drive is over: later steps are in no metric ('' never; `True`: from the hazard on).
    Hazards count all the same.
    """

    name: str
    about: str = ""
    when: str = ""
    stl: str = ""
    for_s: float = 0.0
    margin: str = ""
    unit: str = "-"
    terminal: str = ""

    @property
    def recorded(self) -> bool:
        """Whether the target itself judges it."""
        return not (self.when or self.stl)

    @property
    def metric(self) -> Metric | None:
        """The least margin of a run, where there are margins: a metric `margin_<hazard>`."""
        if not (self.margin or self.stl):
            return None
        return Metric(
            name=f"margin_{self.name.lower()}",
            aggregate="min",
            formula=self.margin,
            unit=self.unit,
            worse="lower",
            about=f"how far the run stayed from {self.name}; negative in it",
        )


class HazardModel(StrictModel, title="A hazard"):
    """By its name. With neither `when` nor `stl` it is taken from the record."""

    about: str = Field("", description="What it is.")
    when: str | None = Field(
        None,
        description="The condition that makes it, over channels and derived values: what triggers may ask "
        "for, and `ever(CONDITION)` (it has held by now) and `rate(x)` (change in a second).",
    )
    stl: str | None = Field(
        None,
        description="Instead of `when`: a formula of signal temporal logic that must hold, as rtamt has it "
        "(`pip install rtamt`), with even steps. The hazard comes at the first step where it does not; with "
        "a formula that looks ahead, as long after that step as it looks ahead.",
    )
    for_s: float = Field(
        0.0, ge=0.0, allow_inf_nan=False, description="How long it must last to be a hazard."
    )
    margin: str | None = Field(
        None,
        description="How far a step is from the hazard, in `unit`; negative in it. Where `when` is one "
        "comparison, the difference of its two sides if nothing else is said.",
    )
    unit: str = Field("-", description="The unit of the margin.")
    terminal: bool | str = Field(
        False,
        description="Whether the drive is over with it, as with a collision; or the condition that ends it.",
    )


class MetricModel(StrictModel, title="A metric"):
    """A column of the results, by its name. Exactly one of the aggregates is given, over the whole drive up
    to the first terminal hazard. Steps whose value is infinite or NaN are skipped."""

    min: str | None = Field(None, description="The least value of this formula over channels.")
    max: str | None = Field(None, description="Its largest.")
    mean: str | None = Field(None, description="Its mean over the steps.")
    last: str | None = Field(None, description="Its value in the last step.")
    integral: str | None = Field(None, description="Its integral over time.")
    duration: str | None = Field(None, description="For how many seconds this condition holds.")
    at_end: str | None = Field(
        None, description="Its value in the step of the first terminal hazard; empty where none came."
    )
    where: str | None = Field(None, description="Only steps count in which this condition holds.")
    unit: str = Field(description="Its unit; `-` for none.")
    worse: _WORSE = Field(description="Whether a `higher` or a `lower` value is worse.")
    about: str = Field(description="What it tells.")
    source: str = Field("", description="Where the formula is from.")


def read_hazards(
    models: list[str] | dict[str, HazardModel],
    known: Collection[str],
    source: Source,
    *,
    recorded: bool,
    step_s: float,
) -> tuple[Hazard, ...]:
    """The hazards of a manifest. `known` are the names that formulas may use; `recorded` says that the target
    leaves a record; a step has `step_s` seconds. MutatorError with the line of whatever is wrong."""
    if isinstance(models, list):
        hazards = tuple(Hazard(name=name) for name in models)
    else:
        hazards = tuple(_hazard(name, model, known, source, step_s) for name, model in models.items())
    if not recorded and (left := [hazard.name for hazard in hazards if hazard.recorded]):
        keys: Keys = ("hazards", left[0]) if isinstance(models, dict) else ("hazards",)
        raise source.error(
            keys,
            f"hazard '{left[0]}' without `when`, in a manifest without `record`",
            expected="the condition that makes it, or a record in which the target tells",
            remedy="say `when`, or name the record",
        )
    return hazards


def _hazard(name: str, model: HazardModel, known: Collection[str], source: Source, step_s: float) -> Hazard:
    keys: Keys = ("hazards", name)
    if model.when is not None and model.stl is not None:
        raise source.error((*keys, "stl"), "`when` and `stl`", expected="one of them", remedy="remove one")
    judged_by = "stl" if model.stl is not None else "the record"
    useless = () if model.when is not None else ("for_s", "margin")
    for key in useless:
        if key in model.model_fields_set:
            raise source.error(
                (*keys, key),
                f"`{key}` of a hazard that is judged by {judged_by}",
                expected="it beside `when`",
                remedy="remove it",
            )
    when = condition(model.when, known, source, (*keys, "when"))
    if model.stl:
        with source.placing((*keys, "stl")):
            stl.check(model.stl, known, step_s)
    terminal = model.terminal
    return Hazard(
        name=name,
        about=model.about,
        when=when,
        stl=model.stl or "",
        for_s=model.for_s,
        margin=formula(model.margin, known, source, (*keys, "margin")) or _margin_of(when),
        unit=model.unit,
        terminal=condition(terminal, known, source, (*keys, "terminal"))
        if isinstance(terminal, str)
        else ("True" if terminal else ""),
    )


def _margin_of(when: str) -> str:
    """The difference of the two sides of a single comparison: positive while it does not hold."""
    node = parse(when) if when else None
    if not isinstance(node, ast.Compare) or len(node.ops) != 1:
        return ""
    low, high = ast.unparse(node.left), ast.unparse(node.comparators[0])
    if isinstance(node.ops[0], ast.Gt | ast.GtE):
        low, high = high, low
    elif not isinstance(node.ops[0], ast.Lt | ast.LtE):
        return ""
    return f"({low} - {high})"


def read_metrics(
    models: dict[str, MetricModel], known: Collection[str], source: Source
) -> tuple[Metric, ...]:
    """The metrics of a manifest; arguments and errors as for `read_hazards`."""
    return tuple(_metric(name, model, known, source) for name, model in models.items())


def _metric(name: str, model: MetricModel, known: Collection[str], source: Source) -> Metric:
    keys: Keys = ("metrics", name)
    if not name.isidentifier():
        raise source.error(keys, f"'{name}'", expected="a name of letters, digits and _", remedy="rename it")
    given = [key for key in _AGGREGATES if getattr(model, key) is not None]
    if len(given) != 1:
        raise source.error(
            keys,
            f"metric '{name}' with {' and '.join(given) or 'no aggregate'}",
            expected=f"one of {', '.join(_AGGREGATES)}",
            remedy="make a metric of each",
        )
    (aggregate,) = given
    check = condition if aggregate == "duration" else formula
    return Metric(
        name=name,
        aggregate=aggregate,
        formula=check(getattr(model, aggregate), known, source, (*keys, aggregate)),
        where=condition(model.where, known, source, (*keys, "where")),
        unit=model.unit,
        worse=model.worse,
        about=model.about,
        source=model.source,
    )
