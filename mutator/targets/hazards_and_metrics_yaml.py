"""The hazards and metrics of a manifest."""

import ast
from collections.abc import Collection
from typing import get_args

from pydantic import Field

from mutator.config.phrases_yaml import build_phrase
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource
from mutator.targets.hazard_and_metric_definitions import Aggregate, Hazard, Metric, WorseDirection
from mutator.targets.manifest_formulas import manifest_condition, manifest_formula
from mutator.targets.stored_phrases import LATER_HOLE
from mutator.triggers import temporal_logic
from mutator.triggers.conditions import GOLDEN_PREFIX, TIME, parse_expression

_AGGREGATES = get_args(Aggregate)


class HazardModel(StrictModel, title="A hazard"):
    """A hazard, by its name. Without `when` and `stl`, it is read from the record.

    A target with [defences](defence.md) needs a hazard for braking that nothing calls for; otherwise, more
    braking always wins. For example `{when: accel < -3.5 and gap > 4 * closing, for_s: 0.5}`: braking harder
    than 3.5 m/s^2 for 0.5 s while the time to collision, `gap / closing`, is above 4 s.
    """

    about: str = Field("", description="What the hazard is.")
    when: str | None = Field(
        None,
        description="The condition of the hazard, over channels and derived values. The syntax is that of "
        "triggers, plus `ever(CONDITION)` (true once the condition has held) and `rate(x)` "
        "(change per second).",
    )
    required_stl: str | None = Field(
        None,
        alias="stl",
        description="Instead of `when`: a formula of signal temporal logic that must hold. rtamt evaluates "
        "it (extra `stl`, Python 3.11 or 3.12), and steps must be evenly spaced. The hazard occurs at the "
        "first step at which the formula does not hold. If the formula looks ahead, the hazard "
        "occurs that much later.",
    )
    for_s: float = Field(
        0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="How long the condition must hold before the hazard occurs, in s.",
    )
    margin: str | None = Field(
        None,
        description="The distance of a step from the hazard, in `unit`; negative if `when` holds. If `when` "
        "is a single comparison, the default is the difference of its two sides.",
    )
    unit: UnitSymbol = Field("-", description="The unit of the margin.")
    phrase: str | list[str] | None = Field(
        None,
        description="The hazard as a clause, for the [sentence](../how-to/word-results.md) about an "
        "experiment: `the car touches the vehicle ahead {later} at {contact_speed}`. Holes: `later` and the "
        "metrics. Of several texts, the first whose holes all have a value is used.",
    )
    terminal: bool | str = Field(
        False,
        description="Whether the hazard ends the drive, as a collision does; or the condition that ends it.",
    )


class MetricModel(StrictModel, title="A metric"):
    """A column of the results, by its name. Give exactly one of the aggregates. They cover the drive up to
    the first terminal hazard, and skip steps in which the value is infinite or NaN. `golden.NAME` is a value
    of the golden run in the same step (`max: abs(gap - golden.gap)`); steps that only one of the runs has are
    skipped.
    """

    min: str | None = Field(None, description="The minimum of this formula over channels.")
    max: str | None = Field(None, description="The maximum of this formula over channels.")
    mean: str | None = Field(None, description="The mean over the steps.")
    last: str | None = Field(None, description="The value in the last step.")
    integral: str | None = Field(None, description="The integral over time.")
    duration: str | None = Field(None, description="The number of seconds in which this condition holds.")
    at_end: str | None = Field(
        None, description="The value in the step of the first terminal hazard; empty if there is none."
    )
    at_hazard: str | None = Field(
        None,
        description="The value in the step in which `hazard` first occurs; empty without it, or if the drive "
        "had ended by then.",
    )
    hazard: str | None = Field(None, description="The hazard of `at_hazard`.")
    where: str | None = Field(None, description="Use only the steps in which this condition holds.")
    ends_before_s: float | None = Field(
        None,
        ge=0.0,
        allow_inf_nan=False,
        description="How long before the first terminal hazard the metric ends, in s; 0 leaves out the step "
        "of the hazard alone. For what means nothing at a contact, such as a time to collision. Default: the "
        "step of the hazard is the last.",
    )
    unit: UnitSymbol = Field(description="The unit; `-` for none.")
    worse: WorseDirection = Field(description="Which values are worse: `higher` or `lower`.")
    about: str = Field(description="What the metric measures.")
    source: str = Field("", description="The source of the formula.")


def build_hazards(
    models: list[str] | dict[str, HazardModel],
    names: Collection[str],
    source: YamlSource,
    *,
    has_record: bool,
    step_s: float,
    metrics: Collection[str] = (),
) -> tuple[Hazard, ...]:
    """Read a manifest's hazards; MutatorError, with the line, for a mistake.

    `names` are those that formulas may use, `metrics` those that phrases may use. `has_record` says whether
    the target writes a record, and `step_s` is the length of a step in seconds.
    """
    if isinstance(models, list):
        hazards = tuple(Hazard(name=name) for name in models)
    else:
        hazards = tuple(
            _build_hazard(name, model, names, source, step_s, metrics) for name, model in models.items()
        )
    if not has_record and (unreported := [hazard.name for hazard in hazards if hazard.is_in_record]):
        keys: KeyPath = ("hazards", unreported[0]) if isinstance(models, dict) else ("hazards",)
        raise source.error(
            keys,
            f"hazard '{unreported[0]}' without `when`, in a manifest without `record`",
            expected="the condition of the hazard, or a record in which the target reports it",
            remedy="add `when`, or name the record",
        )
    return hazards


def _build_hazard(
    name: str,
    model: HazardModel,
    names: Collection[str],
    source: YamlSource,
    step_s: float,
    metrics: Collection[str],
) -> Hazard:
    keys: KeyPath = ("hazards", name)
    if model.when is not None and model.required_stl is not None:
        raise source.error((*keys, "stl"), "`when` and `stl`", expected="one of them", remedy="remove one")
    judged_by = "stl" if model.required_stl is not None else "the record"
    condition_keys = () if model.when is not None else ("for_s", "margin")
    for key in condition_keys:
        if key in model.model_fields_set:
            raise source.error(
                (*keys, key),
                f"`{key}` of a hazard that is judged by {judged_by}",
                expected="this key only with `when`",
                remedy="remove it",
            )
    when = manifest_condition(model.when, names, source, (*keys, "when"))
    if model.required_stl:
        with source.locating_errors((*keys, "stl")):
            temporal_logic.check_stl_formula(model.required_stl, names, step_s)
    terminal = model.terminal
    return Hazard(
        name=name,
        about=model.about,
        when=when,
        required_stl=model.required_stl or "",
        for_s=model.for_s,
        margin=manifest_formula(model.margin, names, source, (*keys, "margin"))
        or _margin_formula_of_comparison(when),
        unit=model.unit,
        phrase=build_phrase(model.phrase, (LATER_HOLE, *metrics), source, (*keys, "phrase")),
        terminal_condition=manifest_condition(terminal, names, source, (*keys, "terminal"))
        if isinstance(terminal, str)
        else ("True" if terminal else ""),
    )


def _margin_formula_of_comparison(when: str) -> str:
    """Return the margin of a single comparison: the difference of its two sides, positive while it does not
    hold.
    """
    node = parse_expression(when) if when else None
    if not isinstance(node, ast.Compare) or len(node.ops) != 1:
        return ""
    low, high = ast.unparse(node.left), ast.unparse(node.comparators[0])
    if isinstance(node.ops[0], ast.Gt | ast.GtE):
        low, high = high, low
    elif not isinstance(node.ops[0], ast.Lt | ast.LtE):
        return ""
    return f"({low} - {high})"


def build_metrics(
    models: dict[str, MetricModel], names: Collection[str], source: YamlSource, *, hazards: Collection[str]
) -> tuple[Metric, ...]:
    """Read a manifest's metrics; `hazards` are the names of its hazards, and the other arguments and the
    errors are those of `build_hazards`.
    """
    names = (*names, *(GOLDEN_PREFIX + name for name in names if name != TIME))
    metrics = tuple(_build_metric(name, model, names, source) for name, model in models.items())
    for metric in metrics:
        if (metric.aggregate == "at_hazard" or metric.hazard) and (
            metric.aggregate != "at_hazard" or metric.where or metric.hazard not in hazards
        ):
            raise source.error(
                ("metrics", metric.name),
                f"`{metric.aggregate}` with the hazard '{metric.hazard}'"
                if metric.hazard
                else "`at_hazard` without `hazard`",
                expected=f"`at_hazard` without `where`, and a hazard: {', '.join(hazards)}",
                remedy="correct them, or choose another aggregate",
            )
    return metrics


def _build_metric(name: str, model: MetricModel, names: Collection[str], source: YamlSource) -> Metric:
    keys: KeyPath = ("metrics", name)
    if not name.isidentifier():
        raise source.error(keys, f"'{name}'", expected="a name of letters, digits and _", remedy="rename it")
    aggregates = [key for key in _AGGREGATES if getattr(model, key) is not None]
    if len(aggregates) != 1:
        raise source.error(
            keys,
            f"metric '{name}' with {' and '.join(aggregates) or 'no aggregate'}",
            expected=f"one of {', '.join(_AGGREGATES)}",
            remedy="give each metric exactly one aggregate",
        )
    (aggregate,) = aggregates
    if aggregate == "at_end" and model.ends_before_s is not None:
        raise source.error(
            (*keys, "ends_before_s"),
            f"metric '{name}' with `at_end` and `ends_before_s`",
            expected="one of them, because `at_end` is the value in the step of the hazard",
            remedy="remove one",
        )
    canonical = manifest_condition if aggregate == "duration" else manifest_formula
    return Metric(
        name=name,
        aggregate=aggregate,
        step_formula=canonical(getattr(model, aggregate), names, source, (*keys, aggregate)),
        where=manifest_condition(model.where, names, source, (*keys, "where")),
        ends_before_s=model.ends_before_s,
        unit=model.unit,
        worse=model.worse,
        about=model.about,
        source=model.source,
        hazard=model.hazard or "",
    )
