"""The severity of hazards: delta-v of a contact, rules for other hazards, and classes on a scale."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from mutator._common.hashing import added_field
from mutator._common.phrase_texts import measured_number_text
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata

SEVERITY_CLASSES = ("S0", "S1", "S2", "S3")  # from ISO 26262-3, the mildest first
DELTA_V_NAME = "delta_v"  # name of the metric


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSettings:
    """Which hazard is a contact, the metric with its closing speed, and the masses of both vehicles."""

    hazard: str
    speed_metric: str
    mass_kg: float
    other_mass_kg: float

    def delta_v_mps(self, closing_speed_mps: float) -> float:
        """Return the change of the ego car's speed in m/s, in an inelastic collision along the line of
        travel; 0 if the closing speed is not positive.
        """
        return max(closing_speed_mps, 0.0) * self.other_mass_kg / (self.mass_kg + self.other_mass_kg)


@dataclass(frozen=True, slots=True, kw_only=True)
class HazardSeverity:
    """Which rule of the scale gives a hazard its class, and which metrics are the values of the rule."""

    __pydantic_config__ = pydantic_mapping_config("Severity of a hazard")

    rule: str = field(metadata=yaml_metadata("A rule of the scale."))
    values: dict[str, str] = field(
        metadata=yaml_metadata("The metric of this target for each value of the rule, in the rule's unit.")
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SeveritySettings:
    """How a manifest classifies its hazards: a contact by delta-v, the others by rules of the scale."""

    scale: str
    contact: ContactSettings | None
    rule_by_hazard: Mapping[str, HazardSeverity]


@dataclass(frozen=True, slots=True, kw_only=True)
class SeverityRule:
    """The classes of a hazard without a contact: (name, smallest value of each metric, meaning), the mildest
    first. `hazard` and `metrics` are those of a target. `judgement` has reasons for bounds without a source.
    """

    name: str
    about: str
    source: str = added_field("")
    judgement: str = added_field("")
    units: tuple[tuple[str, str], ...]  # unit by name of a value
    classes: tuple[tuple[str, tuple[float, ...], str], ...]
    hazard: str = ""
    metrics: tuple[str, ...] = ()

    def for_hazard(self, hazard: str, metric_by_value: Mapping[str, str]) -> "SeverityRule":
        """Return the rule as it applies to a hazard of a target."""
        return replace(self, hazard=hazard, metrics=tuple(metric_by_value[name] for name, _ in self.units))

    def class_of_metrics(self, metrics: Mapping[str, float]) -> str | None:
        """Return the highest class whose bounds all metrics reach; None if a metric has no value."""
        if any(name not in metrics for name in self.metrics):
            return None
        values = [metrics[name] for name in self.metrics]
        reached = [
            name
            for name, bounds, _ in self.classes
            if all(value >= least for value, least in zip(values, bounds, strict=True))
        ]
        return reached[-1] if reached else None


class ClassifiedHazard(NamedTuple):
    """A hazard of a run with its class."""

    hazard: str
    severity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SeverityScale:
    """The classes of delta-v: (name, least delta-v in m/s, meaning), the mildest first, beginning at 0.
    `source` cites the bounds. `words` names classes in a word or two: (name, words).

    `contact` is the hazard that delta-v measures, and `rules` are for other hazards of the target.
    """

    name: str
    about: str
    source: str
    classes: tuple[tuple[str, float, str], ...]
    words: tuple[tuple[str, str], ...] = added_field(())
    contact: str = added_field("")
    rules: tuple[SeverityRule, ...] = added_field(())

    def __post_init__(self) -> None:
        if not any(least <= 0.0 for _, least, _ in self.classes):
            raise ValueError("no class of severity begins at 0")

    @property
    def labels(self) -> dict[str, str]:
        """The classes as people read them, by name: `severe (severity S2)`. S2 alone could be a scenario."""
        words = dict(self.words)
        return {
            name: f"{words.get(name) or about} (severity {name})".lstrip() for name, _, about in self.classes
        }

    def class_of_delta_v(self, delta_v_mps: float) -> str:
        """Return the class of a delta-v in m/s, 0 or more; a value on a bound is in the upper class."""
        return [name for name, least, _ in self.classes if delta_v_mps >= least][-1]

    def with_only_rules_of_metrics(self, metrics: Collection[str]) -> "SeverityScale":
        """Return the scale with those rules alone whose metrics are all among `metrics`."""
        return replace(self, rules=tuple(rule for rule in self.rules if {*rule.metrics} <= {*metrics}))

    def describe_values_behind_class(self, hazard: str, metrics: Mapping[str, float]) -> str:
        """Return the values that give a hazard its class: `delta-v 9.77 m/s`."""
        for rule in self.rules:
            if rule.hazard == hazard:
                values = zip(rule.metrics, rule.units, strict=True)
                texts = [
                    f"{name.replace('_', ' ')} {measured_number_text(metrics[name], unit)}"
                    for name, (_, unit) in values
                ]
                return f"{hazard}: {', '.join(texts)} ({rule.name.replace('_', ' ')})"
        return f"delta-v {measured_number_text(metrics[DELTA_V_NAME], 'm/s')}"

    def worst_hazard(
        self, hazards: Iterable[tuple[str, float]], metrics: Mapping[str, float], t_end: float | None
    ) -> ClassifiedHazard | None:
        """Return the hazard of the highest class; of several, the first. None without a class.

        `hazards` are those at or after the activation, with their times in s, in order; `metrics` has those
        that have a value, and `t_end` is the end of the drive. Later hazards have no class.
        """
        in_drive = [name for name, time in hazards if t_end is None or time <= t_end]
        rule_by_hazard = {rule.hazard: rule for rule in self.rules}
        delta_v = metrics.get(DELTA_V_NAME)
        contact = self.contact or (in_drive or [""])[-1]
        classified = []
        for name in in_drive:
            if name in rule_by_hazard:
                severity = rule_by_hazard[name].class_of_metrics(metrics)
            else:
                severity = self.class_of_delta_v(delta_v) if name == contact and delta_v is not None else None
            if severity is not None:
                classified.append(ClassifiedHazard(name, severity))
        return max(classified, key=lambda hazard: hazard.severity, default=None)
