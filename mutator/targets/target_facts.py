"""What a run states about the channels and metrics of its target, so that readers need no manifest.

In run.json, each is the list of its values in the order of the fields.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from mutator.targets.channels import Role
from mutator.targets.manifest import TargetManifest

T_END = "t_end"  # the metric column with the end of the drive


@dataclass(frozen=True, slots=True)
class ChannelFacts:
    """A recorded channel. `about` is its meaning; `component` is '' if the manifest names none."""

    name: str
    unit: str
    role: Role
    component: str
    about: str

    @classmethod
    def from_plain(cls, values: Sequence[str]) -> "ChannelFacts":
        """Read the stored form; ValueError if it has another length or an unknown role."""
        name, unit, role, component, about = values
        return cls(name, unit, Role(role), component, about)

    def plain(self) -> list[str]:
        return [self.name, self.unit, self.role.value, self.component, self.about]


@dataclass(frozen=True, slots=True)
class MetricFacts:
    """A metric column. `worse` is the direction of its worse values, `higher` or `lower`."""

    name: str
    unit: str
    about: str
    worse: str

    @classmethod
    def from_plain(cls, values: Sequence[str]) -> "MetricFacts":
        """Read the stored form; ValueError if it has another length."""
        name, unit, about, worse = values
        return cls(name, unit, about, worse)

    def plain(self) -> list[str]:
        return [self.name, self.unit, self.about, self.worse]


def channel_facts(manifest: TargetManifest) -> tuple[ChannelFacts, ...]:
    return tuple(ChannelFacts(c.name, c.unit, c.role, c.component, c.about) for c in manifest.channels)


def metric_facts(manifest: TargetManifest) -> tuple[MetricFacts, ...]:
    """Return the facts of each metric column. If a hazard can end the drive, its end comes first."""
    about = "when a terminal hazard ended the drive; metrics do not cover later steps"
    end = (
        [MetricFacts(T_END, "s", about, "lower")] if any(hazard.terminal for hazard in manifest.rules) else []
    )
    return (*end, *(MetricFacts(m.name, m.unit, m.about, m.worse) for m in manifest.measures))
