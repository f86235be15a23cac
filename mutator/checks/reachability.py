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
from mutator.campaigns.campaign_triggers import build_listed_triggers
from mutator.checks.findings import CheckState, Finding, FindingPlace
from mutator.faults.fault_models import FaultModel, FaultModels, SnippetKind
from mutator.model import Fault, FaultLocation, Injection, Method, Trigger
from mutator.mutants.mutant_building import Mutant, build
from mutator.preflight.unreached_triggers import armed_condition_of, is_ever_active
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger, trigger_at_time
from mutator.workspace import Workspace

_COUNTING_MODEL = "count_only"
_MOST_PLACES = 20  # places listed in a finding


@dataclass(frozen=True, kw_only=True)
class SpecStatement:
    """A statement that fault specs name, and the scenario changes that its faults need."""

    location: FaultLocation
    place: FindingPlace  # in the spec
    changes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class LibraryTrigger:
    """A trigger of a context table or of a campaign's list, armed as in campaigns."""

    trigger: Trigger
    place: FindingPlace  # in the table or the campaign


class ReachTracker:
    """The statements and triggers of a library that no run has reached yet."""

    def __init__(self, workspace: Workspace, manifest: TargetManifest, campaigns: Sequence[Campaign]) -> None:
        self._manifest = manifest
        statements = list(_spec_statements(workspace, manifest))
        self._statement_count = len(statements)
        self.counting_mutant, self._location_by_id = _build_counting_mutant(
            workspace, manifest, [statement.location for statement in statements]
        )
        self.unexecuted_statements = statements
        self.unreached_triggers = list(_library_triggers(workspace, manifest, campaigns))
        self._trigger_count = len(self.unreached_triggers)
        self._scenarios_run: list[str] = []  # scenarios with their changes
        self._condition_by_trigger = {
            statement.trigger: armed_condition_of(workspace, manifest, statement.trigger)
            for statement in self.unreached_triggers
        }

    def record_run(
        self,
        scenario: str,
        changes: Sequence[str],
        probe: Mapping[str, Any] | None,
        observations: Iterable[Sequence[float]],
    ) -> None:
        """Remove the statements and triggers that a run of the counting mutant reached, according to its
        probe's report and its observations (`observations`).

        A statement is removed only if the run had the changes that its fault needs.
        """
        self._scenarios_run.append("+".join((scenario, *changes)))
        counts = (probe or {}).get("injections", {})
        executed = {self._location_by_id[name] for name, entry in counts.items() if entry["count"]}
        self.unexecuted_statements = [
            statement
            for statement in self.unexecuted_statements
            if statement.location not in executed or not set(statement.changes) <= set(changes)
        ]
        rows = np.array(list(observations), dtype=float)
        self.unreached_triggers = [
            statement
            for statement in self.unreached_triggers
            if not is_ever_active(self._condition_by_trigger[statement.trigger], rows)
        ]

    def findings(self) -> list[Finding]:
        return [
            self._reach_finding(
                "statement",
                self._statement_count,
                [statement.place for statement in self.unexecuted_statements],
                "faults there are never active: anchor them elsewhere, or add a scenario that reaches these "
                "statements",
            ),
            self._reach_finding(
                "trigger",
                self._trigger_count,
                [statement.place for statement in self.unreached_triggers],
                "faults with such a trigger are never active: add a scenario in which it holds, or remove "
                "it from the campaigns",
            ),
        ]

    def _reach_finding(
        self, noun: str, count: int, unreached: Sequence[FindingPlace], remedy: str
    ) -> Finding:
        name, whole = f"{noun}s", counted(count, noun)
        if not unreached:
            message = f"{whole}, {'which is' if count == 1 else 'which are all'} reached" if count else "none"
            return Finding(name=name, level=CheckState.OK, found=message)
        message = f"{len(unreached)} of {whole} never reached in {', '.join(self._scenarios_run)}"
        places = tuple(unreached[:_MOST_PLACES])
        return Finding(name=name, level=CheckState.WARN, found=message, remedy=remedy, places=places)


def _spec_statements(workspace: Workspace, manifest: TargetManifest) -> Iterator[SpecStatement]:
    """Yield the first injection of each statement, for each set of changes."""
    yielded = set[object]()
    for spec in workspace.specs():
        for variant in spec:
            for injection in (
                injection_spec
                for reading in variant.injections_by_reading.values()
                for injection_spec in reading
            ):
                at, key = injection.location, (injection.location, variant.changes)
                if key not in yielded:
                    yielded.add(key)
                    anchor = f"{at.anchor.kind.value} {at.anchor.name}".strip()
                    what = f"{spec.name}/{variant.name}: {at.path}, {at.function}, {anchor}"
                    place = FindingPlace(
                        file=str(spec.path), line=spec.source.line_of(injection.keys), what=what
                    )
                    yield SpecStatement(location=at, place=place, changes=variant.changes)


def _build_counting_mutant(
    workspace: Workspace, manifest: TargetManifest, locations: Iterable[FaultLocation]
) -> tuple[Mutant, Mapping[str, FaultLocation]]:
    """Return the mutant that counts at all these places, and the location of each injection id."""
    models, once = workspace.fault_models(), list(dict.fromkeys(locations))
    injections = tuple(Injection(location=location, model=_COUNTING_MODEL) for location in once)
    fault = Fault(
        _COUNTING_MODEL, _COUNTING_MODEL, _COUNTING_MODEL, _COUNTING_MODEL, None, "", "", injections
    )
    mutant = build(manifest, _with_counting_model(models), fault, always_trigger())
    return mutant, dict(zip(mutant.injection_ids, once, strict=True))


def _with_counting_model(models: FaultModels) -> FaultModels:
    some = next(iter(models))
    count = FaultModel(
        name=_COUNTING_MODEL,
        kind=SnippetKind.INSERT,
        about="counts",
        params=(),
        examples=(),
        template='_fi.active("{{ fi }}")\n',
        expression_template="{{ original }}",
        source=some.source,
        template_path=some.template_path,
    )
    return replace(models, models={**models.models, _COUNTING_MODEL: count})


def _library_triggers(
    workspace: Workspace, manifest: TargetManifest, campaigns: Sequence[Campaign]
) -> Iterator[LibraryTrigger]:
    """Yield the triggers that campaigns use, each armed as early as in any campaign, and the latest random
    times. Without campaigns, the triggers of all context tables.
    """
    armed_after_s_by_row: dict[tuple[str, str], float] = {}
    for campaign in campaigns:
        earliest = min(campaign.armed_after_s_by_reading.values(), default=manifest.armed_after_s)
        for row in _context_table_and_row_ids(workspace, campaign):
            armed_after_s_by_row[row] = min(armed_after_s_by_row.get(row, earliest), earliest)
        yield from _listed_triggers(campaign, manifest, earliest)
        if (until := campaign.random_until_s) is not None and Method.RANDOM in campaign.methods:
            what = f"{campaign.name}: random times until {until:g} s"
            place = _yaml_place(
                campaign.path, campaign.yaml_source.line_of(("triggers", "random_until_s")), what
            )
            yield LibraryTrigger(trigger=trigger_at_time(until, name=campaign.name), place=place)
    for name in {table: None for table, _ in armed_after_s_by_row} if campaigns else workspace.context_tables:
        table = workspace.context_table(name)
        for trigger in table.triggers(armed_after_s=manifest.armed_after_s):
            if not campaigns or (name, trigger.name) in armed_after_s_by_row:
                after = armed_after_s_by_row.get((name, trigger.name), manifest.armed_after_s)
                what = f"{name}, {trigger.name}: {trigger.condition}, armed after {after:g} s"
                place = _yaml_place(table.source.path, table.source.line_of(("contexts", trigger.name)), what)
                yield LibraryTrigger(trigger=replace(trigger, armed_after_s=after), place=place)


def _context_table_and_row_ids(workspace: Workspace, campaign: Campaign) -> list[tuple[str, str]]:
    if campaign.context_table is None:
        return []
    rows = campaign.context_ids or [row.id for row in workspace.context_table(campaign.context_table).rows]
    return [(campaign.context_table, row) for row in rows]


def _listed_triggers(
    campaign: Campaign, manifest: TargetManifest, armed_after_s: float
) -> Iterator[LibraryTrigger]:
    triggers = build_listed_triggers(
        campaign.listed_triggers,
        campaign.yaml_source,
        manifest,
        armed_after_s=armed_after_s,
        hold_s=campaign.hold_s,
    )
    for i, trigger in enumerate(triggers):
        what = f"{campaign.name}: {trigger.name}"
        yield LibraryTrigger(
            trigger=trigger,
            place=_yaml_place(campaign.path, campaign.yaml_source.line_of(("triggers", "list", i)), what),
        )


def _yaml_place(path: Path, line: int | None, what: str) -> FindingPlace:
    return FindingPlace(file=str(path), line=line, what=what)
