"""Find out which statements of fault specs, and which triggers, golden runs reach.

One mutant has a counting probe call at each of these statements. A statement is counted exactly when a fault
there would be active if the fault's trigger always held.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.message_text import counted
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.campaign_triggers import listed_triggers
from mutator.checks.findings import Finding, Level, Place
from mutator.faults.fault_models import FaultModel, FaultModels, SnippetKind
from mutator.model import Fault, FaultLocation, Injection, Method, Trigger
from mutator.mutants.mutant_building import Mutant, build
from mutator.preflight.unreached_triggers import decision_of, holds
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always, at_time
from mutator.workspace import Workspace

_COUNT = "count_only"
_MOST = 20  # places listed in a finding


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """A statement that fault specs name, and the scenario changes that its faults need."""

    location: FaultLocation
    place: Place  # in the spec
    changes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Awaited:
    """A trigger of a context table or of a campaign's list, armed as in campaigns."""

    trigger: Trigger
    place: Place  # in the table or the campaign


class Reach:
    """The statements and triggers of a library that no run has reached yet."""

    def __init__(self, workspace: Workspace, manifest: TargetManifest, campaigns: Sequence[Campaign]) -> None:
        self._manifest = manifest
        wanted = list(_statements(workspace, manifest))
        self._statements = len(wanted)
        self.counting, self._ids = _counting(workspace, manifest, [one.location for one in wanted])
        self.unexecuted = wanted
        self.untriggered = list(_triggers(workspace, manifest, campaigns))
        self._triggers = len(self.untriggered)
        self._driven: list[str] = []  # scenarios with their changes
        self._decisions = {
            one.trigger: decision_of(workspace, manifest, one.trigger) for one in self.untriggered
        }

    def take(
        self,
        scenario: str,
        changes: Sequence[str],
        probe: Mapping[str, Any] | None,
        seen: Iterable[Sequence[float]],
    ) -> None:
        """Remove the statements and triggers that a run of the counting mutant reached, according to its
        probe's report and its observations (`seen`).

        A statement is removed only if the run had the changes that its fault needs.
        """
        self._driven.append("+".join((scenario, *changes)))
        counts = (probe or {}).get("injections", {})
        executed = {self._ids[name] for name, told in counts.items() if told["count"]}
        self.unexecuted = [
            one
            for one in self.unexecuted
            if one.location not in executed or not set(one.changes) <= set(changes)
        ]
        rows = np.array(list(seen), dtype=float)
        self.untriggered = [one for one in self.untriggered if not holds(self._decisions[one.trigger], rows)]

    def findings(self) -> list[Finding]:
        return [
            self._finding(
                "statement",
                self._statements,
                [one.place for one in self.unexecuted],
                "faults there are never active: anchor them elsewhere, or add a scenario that reaches these "
                "statements",
            ),
            self._finding(
                "trigger",
                self._triggers,
                [one.place for one in self.untriggered],
                "faults with such a trigger are never active: add a scenario in which it holds, or remove "
                "it from the campaigns",
            ),
        ]

    def _finding(self, noun: str, count: int, left: Sequence[Place], remedy: str) -> Finding:
        name, whole = f"{noun}s", counted(count, noun)
        if not left:
            found = f"{whole}, {'which is' if count == 1 else 'which are all'} reached" if count else "none"
            return Finding(name=name, level=Level.OK, found=found)
        found = f"{len(left)} of {whole} never reached in {', '.join(self._driven)}"
        places = tuple(left[:_MOST])
        return Finding(name=name, level=Level.WARN, found=found, remedy=remedy, places=places)


def _statements(workspace: Workspace, manifest: TargetManifest) -> Iterator[Wanted]:
    """Yield the first injection of each statement, for each set of changes."""
    seen = set[object]()
    for spec in workspace.specs():
        for variant in spec:
            for injection in (one for reading in variant.readings.values() for one in reading):
                at, key = injection.location, (injection.location, variant.changes)
                if key not in seen:
                    seen.add(key)
                    anchor = f"{at.anchor.kind.value} {at.anchor.name}".strip()
                    what = f"{spec.name}/{variant.name}: {at.path}, {at.function}, {anchor}"
                    place = Place(file=str(spec.path), line=spec.source.line(injection.keys), what=what)
                    yield Wanted(location=at, place=place, changes=variant.changes)


def _counting(
    workspace: Workspace, manifest: TargetManifest, locations: Iterable[FaultLocation]
) -> tuple[Mutant, Mapping[str, FaultLocation]]:
    """Return the mutant that counts at all these places, and the location of each injection id."""
    models, once = workspace.fault_models(), list(dict.fromkeys(locations))
    injections = tuple(Injection(location=location, model=_COUNT) for location in once)
    fault = Fault(_COUNT, _COUNT, _COUNT, _COUNT, None, "", "", injections)
    mutant = build(manifest, _with_count(models), fault, always())
    return mutant, dict(zip(mutant.injections, once, strict=True))


def _with_count(models: FaultModels) -> FaultModels:
    some = next(iter(models))
    count = FaultModel(
        name=_COUNT,
        kind=SnippetKind.INSERT,
        about="counts",
        params=(),
        examples=(),
        template='_fi.active("{{ fi }}")\n',
        expression="{{ original }}",
        source=some.source,
        template_path=some.template_path,
    )
    return replace(models, models={**models.models, _COUNT: count})


def _triggers(
    workspace: Workspace, manifest: TargetManifest, campaigns: Sequence[Campaign]
) -> Iterator[Awaited]:
    """Yield the triggers that campaigns use, each armed as early as in any campaign, and the latest random
    times. Without campaigns, the triggers of all context tables.
    """
    armed: dict[tuple[str, str], float] = {}
    for campaign in campaigns:
        earliest = min(campaign.armed_after_s.values(), default=manifest.armed_after_s)
        for row in _rows(workspace, campaign):
            armed[row] = min(armed.get(row, earliest), earliest)
        yield from _listed(campaign, manifest, earliest)
        if (until := campaign.random_until_s) is not None and Method.RANDOM in campaign.methods:
            what = f"{campaign.name}: random times until {until:g} s"
            place = _place(campaign.path, campaign.yaml.line(("triggers", "random_until_s")), what)
            yield Awaited(trigger=at_time(until, name=campaign.name), place=place)
    for name in {table: None for table, _ in armed} if campaigns else workspace.context_tables:
        table = workspace.context_table(name)
        for trigger in table.triggers(armed_after_s=manifest.armed_after_s):
            if not campaigns or (name, trigger.name) in armed:
                after = armed.get((name, trigger.name), manifest.armed_after_s)
                what = f"{name}, {trigger.name}: {trigger.condition}, armed after {after:g} s"
                place = _place(table.source.path, table.source.line(("contexts", trigger.name)), what)
                yield Awaited(trigger=replace(trigger, armed_after_s=after), place=place)


def _rows(workspace: Workspace, campaign: Campaign) -> list[tuple[str, str]]:
    if campaign.table is None:
        return []
    rows = campaign.rows or [row.id for row in workspace.context_table(campaign.table).rows]
    return [(campaign.table, row) for row in rows]


def _listed(campaign: Campaign, manifest: TargetManifest, armed_after_s: float) -> Iterator[Awaited]:
    triggers = listed_triggers(
        campaign.listed, campaign.yaml, manifest, armed_after_s=armed_after_s, hold_s=campaign.hold_s
    )
    for i, trigger in enumerate(triggers):
        what = f"{campaign.name}: {trigger.name}"
        yield Awaited(
            trigger=trigger, place=_place(campaign.path, campaign.yaml.line(("triggers", "list", i)), what)
        )


def _place(path: Path, line: int | None, what: str) -> Place:
    return Place(file=str(path), line=line, what=what)
