"""The severity of a manifest, and the scales of a library."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from pydantic import Field

from mutator.config.units import UNITS
from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.hazard_and_metric_definitions import Hazard, Metric
from mutator.targets.hazard_severity import (
    SEVERITY_CLASSES,
    ContactSettings,
    HazardSeverity,
    SeverityRule,
    SeverityScale,
    SeveritySettings,
)

SCHEMA = "severity/1"
_CONTACT_KEYS = ("contact", "contact_speed", "mass_kg", "other_mass_kg")
_MPS_PER_KPH = UNITS["kph"].si_factor


class _SeverityClassModel(StrictModel, title="A class"):
    from_kph: float = Field(
        ge=0.0, allow_inf_nan=False, description="The smallest delta-v in the class; 0 for S0."
    )
    words: str = Field(
        "", description="The harm in a word or two, shown after the name of the class. Default: `about`."
    )
    about: str = Field(description="The harm in this class.")


class _RuleClassModel(StrictModel, title="A class of a rule"):
    least: dict[str, float] = Field(
        default_factory=dict,
        alias="from",
        description="The smallest value of each quantity in the class, in its unit; 0 for those left out. "
        "All of them must be reached.",
    )
    about: str = Field(description="Why a run that reaches the bounds is in this class.")


class _RuleModel(StrictModel, title="A rule"):
    """Bounds over values of a run, for a hazard that is no contact. A manifest says which metrics the values
    are. Give `source` or `judgement`, or both.
    """

    about: str = Field(description="What is judged, and what lies there.")
    source: str = Field("", description="The source of the bounds.")
    judgement: str = Field(
        "", description="Marks bounds that no source gives: the reasons for which they were chosen."
    )
    values: dict[str, str] = Field(min_length=1, description="The values that are judged, with their units.")
    classes: dict[str, _RuleClassModel] = Field(
        description="Some of the classes S0 to S3, beginning with S0, in order. A run is in the highest "
        "whose bounds it reaches."
    )


class SeverityScaleModel(StrictModel, title="severity/*.yaml"):
    """The bounds of each class. A library can contain several scales."""

    about: str = Field("", description="The purpose of the scale.")
    source: str = Field(description="The source of the bounds.")
    classes: dict[str, _SeverityClassModel] = Field(
        description="The classes S0, S1, S2 and S3; each begins at a higher delta-v than the one before."
    )
    rules: dict[str, _RuleModel] = Field(
        default_factory=dict, description="Rules for hazards that are no contact, by name."
    )


class SeverityModel(StrictModel, title="Severity"):
    """How severe hazards are. The four keys from `contact` to `other_mass_kg` go together. The metric
    `delta_v` is then the delta-v of the ego car, `contact_speed * other_mass_kg / (mass_kg + other_mass_kg)`.
    """

    contact: str | None = Field(
        None, description="The terminal hazard that is a contact with another vehicle."
    )
    contact_speed: str | None = Field(
        None,
        description="The metric that holds the closing speed at the contact: one with `at_end`, in m/s. If "
        "it is negative, the cars separate, and delta-v is 0.",
    )
    mass_kg: float | None = Field(None, gt=0.0, allow_inf_nan=False, description="The mass of the ego car.")
    other_mass_kg: float | None = Field(
        None, gt=0.0, allow_inf_nan=False, description="The mass of the other vehicle."
    )
    hazards: dict[str, YamlRecord[HazardSeverity]] = Field(
        default_factory=dict,
        description="Other hazards that have a class: for each, a rule of the scale and its values.",
    )
    scale: str = Field(
        description="The name of a file in the library's `severity/`, without `.yaml`; or `collision`, which "
        "ships with mutator."
    )


def build_severity(
    model: SeverityModel, hazards: Sequence[Hazard], metrics: Sequence[Metric], source: YamlSource
) -> SeveritySettings:
    """Read a manifest's severity; MutatorError, with the line, for an unsuitable hazard or metric."""
    contact = _build_contact(model, source)
    if contact:
        _check_contact(contact, hazards, metrics, source)
    names = [hazard.name for hazard in hazards if hazard.name != model.contact]
    metric_names = [metric.name for metric in metrics]
    for name, hazard in model.hazards.items():
        keys = ("severity", "hazards", name)
        if name not in names:
            raise source.error(
                keys,
                f"'{name}'",
                expected=f"a hazard other than `contact`: {', '.join(names) or 'there is none'}",
                remedy="correct the name",
            )
        for value, metric in hazard.values.items():
            if metric not in metric_names:
                raise source.error(
                    (*keys, "values", value),
                    f"'{metric}'",
                    expected=f"a metric: {', '.join(metric_names) or 'there is none'}",
                    remedy="correct the name, or add the metric",
                )
    return SeveritySettings(scale=model.scale, contact=contact, rule_by_hazard=model.hazards)


def _build_contact(model: SeverityModel, source: YamlSource) -> ContactSettings | None:
    if (
        model.contact is not None
        and model.contact_speed is not None
        and model.mass_kg is not None
        and model.other_mass_kg is not None
    ):
        return ContactSettings(
            hazard=model.contact,
            speed_metric=model.contact_speed,
            mass_kg=model.mass_kg,
            other_mass_kg=model.other_mass_kg,
        )
    present_keys = [key for key in _CONTACT_KEYS if getattr(model, key) is not None]
    if present_keys or not model.hazards:
        raise source.error(
            ("severity",),
            f"`severity` with {', '.join(present_keys) or 'neither `contact` nor `hazards`'}",
            expected=f"all of {', '.join(_CONTACT_KEYS)}, or `hazards`",
            remedy="add the missing keys",
        )
    return None


def _check_contact(
    contact: ContactSettings, hazards: Sequence[Hazard], metrics: Sequence[Metric], source: YamlSource
) -> None:
    """Raise MutatorError, with the line, for an unsuitable hazard or metric of a manifest's severity."""
    terminal = [hazard.name for hazard in hazards if hazard.terminal_condition]
    if contact.hazard not in terminal:
        raise source.error(
            ("severity", "contact"),
            f"'{contact.hazard}'",
            expected=f"a hazard with `terminal`: {', '.join(terminal) or 'there is none'}",
            remedy="correct the name, or add `terminal: true` to the hazard",
        )
    speeds = [m.name for m in metrics if m.aggregate == "at_end" and m.unit == "m/s"]
    if contact.speed_metric not in speeds:
        raise source.error(
            ("severity", "contact_speed"),
            f"'{contact.speed_metric}'",
            expected=f"a metric with `at_end` and the unit m/s: {', '.join(speeds) or 'there is none'}",
            remedy="correct the name, or add the metric",
        )


def load_severity_scale(path: Path) -> SeverityScale:
    """Read a scale of a library; MutatorError, with the line, unless the classes are S0 to S3 in order."""
    model, source = load_yaml_model(path, SeverityScaleModel, SCHEMA)
    if tuple(model.classes) != SEVERITY_CLASSES:
        raise source.error(
            ("classes",),
            f"the classes {', '.join(model.classes)}" if model.classes else "no classes",
            expected=f"{', '.join(SEVERITY_CLASSES)}, in this order",
            remedy="define each of these classes once",
        )
    lower_bounds = [model_class.from_kph for model_class in model.classes.values()]
    for i, name in enumerate(SEVERITY_CLASSES):
        if (i == 0 and lower_bounds[0] != 0.0) or (i and lower_bounds[i] <= lower_bounds[i - 1]):
            raise source.error(
                ("classes", name, "from_kph"),
                f"{lower_bounds[i]:g}",
                expected="0 for S0, and for each other class more than for the one before it",
                remedy="correct the bound",
            )
    return SeverityScale(
        name=path.stem,
        about=model.about,
        source=model.source,
        classes=tuple(
            (name, severity_class.from_kph * _MPS_PER_KPH, severity_class.about)
            for name, severity_class in model.classes.items()
        ),
        words=tuple(
            (name, severity_class.words)
            for name, severity_class in model.classes.items()
            if severity_class.words
        ),
        rules=tuple(_build_rule(name, rule, source) for name, rule in model.rules.items()),
    )


def _build_rule(name: str, model: _RuleModel, source: YamlSource) -> SeverityRule:
    keys = ("rules", name)
    if not (model.source or model.judgement):
        raise source.error(
            keys,
            f"rule '{name}' without a source",
            expected="`source`, or `judgement` with the reasons",
            remedy="add one of them",
        )
    names = [class_name for class_name in SEVERITY_CLASSES if class_name in model.classes]
    if list(model.classes) != names or "S0" not in names:
        raise source.error(
            (*keys, "classes"),
            f"the classes {', '.join(model.classes) or 'of no name'}",
            expected=f"S0 and some of {', '.join(SEVERITY_CLASSES[1:])}, in order",
            remedy="correct the names",
        )
    before: tuple[float, ...] = ()
    for class_name, rule_class in model.classes.items():
        bounds = tuple(rule_class.least.get(value, 0.0) for value in model.values)
        is_higher = bounds != before and all(new >= old for new, old in zip(bounds, before, strict=False))
        if not ({*rule_class.least} <= {*model.values} and (is_higher if before else not any(bounds))):
            raise source.error(
                (*keys, "classes", class_name),
                f"{rule_class.least}",
                expected=f"bounds of {', '.join(model.values)}: none for S0, and for each other class none "
                "lower than in the one before, and one higher",
                remedy="correct the bounds",
            )
        before = bounds
    return SeverityRule(
        name=name,
        about=model.about,
        source=model.source,
        judgement=model.judgement,
        units=tuple(model.values.items()),
        classes=tuple(
            (class_name, tuple(rule_class.least.get(value, 0.0) for value in model.values), rule_class.about)
            for class_name, rule_class in model.classes.items()
        ),
    )


def scale_for_target(
    scale: SeverityScale, settings: SeveritySettings, metrics: Sequence[Metric], source: YamlSource
) -> SeverityScale:
    """Return the scale with the rules that a manifest uses; MutatorError, at the manifest's line, for an
    unknown rule, or values that are not the rule's.
    """
    rules = []
    unit_by_metric = {metric.name: metric.unit for metric in metrics}
    for hazard, applied in settings.rule_by_hazard.items():
        keys = ("severity", "hazards", hazard)
        rule = next((rule for rule in scale.rules if rule.name == applied.rule), None)
        if rule is None:
            raise source.error(
                (*keys, "rule"),
                f"'{applied.rule}'",
                expected=f"a rule of the scale {scale.name}: "
                f"{', '.join(rule.name for rule in scale.rules) or 'it has none'}",
                remedy="correct the name, or add the rule to the scale",
            )
        units = {value: unit_by_metric[metric] for value, metric in applied.values.items()}
        if units != dict(rule.units):
            raise source.error(
                (*keys, "values"),
                ", ".join(f"{value} in {unit}" for value, unit in units.items()) or "no values",
                expected=", ".join(f"{value} in {unit}" for value, unit in rule.units),
                remedy="name a metric for each value of the rule, in its unit",
            )
        rules.append(rule.for_hazard(hazard, applied.values))
    return replace(scale, contact=settings.contact.hazard if settings.contact else "", rules=tuple(rules))
