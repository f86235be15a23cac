"""A defence: what it senses, when it acts, and which commands it may change."""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from mutator.config.yaml_source_lines import YamlSource
from mutator.defences.defence_models import DefenceModelFile
from mutator.targets.observed_values import ObservedValue
from mutator.triggers.conditions import names_in


class Role(StrEnum):
    """What a defence is for a safety case; the distinction is that of ISO 26262-1."""

    SAFETY_MECHANISM = "safety_mechanism"  #: part of the system
    EXTERNAL_MEASURE = "external_measure"  #: outside of the system
    DRIVER = "driver"  #: a person


class Kind(StrEnum):
    """What a defence does."""

    DRIVER = "driver"
    EMERGENCY_BRAKING = "emergency_braking"
    LIMIT = "limit"
    MONITOR = "monitor"
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sense:
    """A sensed value: ground truth, or a value of the controller, which faults reach.

    `value` is its name in the manifest; `noise` is a standard deviation in its unit.
    """

    name: str
    is_truth: bool
    value: str
    delay_s: float
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A number of a defence, for its conditions and its model."""

    name: str
    value: float
    unit: str
    about: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Defence:
    """A defence of a library. Conditions and formulas are canonical texts over sensed and derived values and
    parameters.

    `model_parameters` are the parameters that the model takes, and `model_code` is the model's file.
    """

    name: str
    about: str
    role: Role
    kind: Kind
    reference: str  # where its numbers come from
    model: str
    model_path: Path
    model_code: bytes = field(repr=False)
    model_file: DefenceModelFile = field(repr=False, compare=False)
    senses: tuple[Sense, ...]
    derived: tuple[ObservedValue, ...]
    parameters: tuple[Parameter, ...]
    model_parameters: tuple[str, ...]
    acts_when: str
    acts_after_s: float
    lets_go_when: str
    lets_go_after_s: float
    commands: tuple[str, ...]
    priority: float
    digest: str  # of its file and its model
    source: YamlSource = field(repr=False, compare=False)

    @property
    def names_in_formulas(self) -> frozenset[str]:
        """The names that conditions and formulas use."""
        texts = (self.acts_when, self.lets_go_when, *(value.text for value in self.derived))
        return frozenset(name for text in texts for name in names_in(text))
