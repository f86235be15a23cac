"""What a target records: channels, their roles, and the trace file."""

from dataclasses import dataclass, field
from enum import StrEnum

from mutator.targets.stored_phrases import PhraseByCase

ROUNDING_TOLERANCE = 1e-9  # in a channel's unit; smaller differences can come from the order of sums


class Role(StrEnum):
    """A channel's role in a verdict: a fault has manifested if an `actuator` channel differs from the golden
    run.
    """

    ACTUATOR = "actuator"
    TRUTH = "truth"
    INTERNAL = "internal"

    @property
    def default_tolerance(self) -> float:
        return 0.0 if self is Role.ACTUATOR else ROUNDING_TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A recorded channel.

    * `unit`: for axis labels, `-` for none
    * `tolerance`: how much the channel may differ from the golden run (0: must be equal)
    * `component`: the part of the controller to which the channel belongs
    * `time`: the channel that holds its times, if it is not recorded in each step
    * `other_trace_name`: its name in the trace, if that differs
    * `phrase`: of an actuator, what the car does if it is `higher` or `lower` than in the golden run
    """

    name: str
    unit: str
    role: Role = Role.INTERNAL
    component: str = ""
    tolerance: float = 0.0
    about: str = ""
    times_channel: str = ""
    other_trace_name: str = ""
    phrase: PhraseByCase = field(default_factory=dict, hash=False)

    @property
    def name_in_trace(self) -> str:
        return self.other_trace_name or self.name
