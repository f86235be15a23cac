"""What a run states about its target, so that readers need no manifest."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from mutator._common.hashing import added_field
from mutator.targets.channels import Role
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest

DRIVE_END_COLUMN = "t_end"  # the metric column with the end of the drive


class ChannelFacts(NamedTuple):
    """A recorded channel. `about` is its meaning; `component` is '' if the manifest names none.

    In run.json, channels and metrics are the lists of their values.
    """

    name: str
    unit: str
    role: Role
    component: str
    about: str


class MetricFacts(NamedTuple):
    """A metric column. `worse` is the direction of its worse values, `higher` or `lower`."""

    name: str
    unit: str
    about: str
    worse: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HazardFacts:
    """A hazard. `about` is its meaning; a `terminal` one ends the drive."""

    name: str
    about: str
    terminal: bool


@dataclass(frozen=True, kw_only=True)
class TargetFacts:
    """What run.json says about the target, key by key: docs/reference/run-folder.md says what each means."""

    hazards: tuple[str, ...]
    alerts: tuple[str, ...]
    compared: tuple[str, ...]
    metrics: tuple[MetricFacts, ...]
    about_hazards: tuple[HazardFacts, ...]
    severity: SeverityScale | None
    channels: tuple[ChannelFacts, ...]
    structure: Mapping[str, Any] | None
    golden_files: tuple[str, ...]
    target_files: Mapping[str, str]
    speed: str = added_field("")


def channel_facts(manifest: TargetManifest) -> tuple[ChannelFacts, ...]:
    return tuple(ChannelFacts(c.name, c.unit, c.role, c.component, c.about) for c in manifest.channels)


def metric_facts(manifest: TargetManifest) -> tuple[MetricFacts, ...]:
    """Return the facts of each metric column. If a hazard can end the drive, its end comes first."""
    about = "when a terminal hazard ended the drive; metrics do not cover later steps"
    end = (
        [MetricFacts(DRIVE_END_COLUMN, "s", about, "lower")]
        if any(hazard.terminal_condition for hazard in manifest.hazard_rules)
        else []
    )
    return (*end, *(MetricFacts(m.name, m.unit, m.about, m.worse) for m in manifest.all_metrics))


def hazard_facts(manifest: TargetManifest) -> tuple[HazardFacts, ...]:
    return tuple(
        HazardFacts(name=hazard.name, about=hazard.about, terminal=bool(hazard.terminal_condition))
        for hazard in manifest.hazard_rules
    )
