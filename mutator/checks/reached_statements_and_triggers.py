"""Find out which statements of fault specs, and which triggers, golden runs reach.

One mutant has a counting probe call at each of these statements. A statement is counted exactly when a fault
there would be active if the fault's trigger always held.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mutator._common.message_text import counted
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.campaign_triggers import build_listed_triggers
from mutator.checks.check_findings import CheckState, Finding, FindingPlace
from mutator.engines.engine_jobs import Job, JobResult
from mutator.faults.message_places import location_of
from mutator.model import FaultLocation, Method, Trigger
from mutator.mutants.execution_counting_mutant import build_counting_mutant
from mutator.outcomes.inactivity_reasons import PlaceReach, Reach, reach_of_place
from mutator.preflight.unreached_triggers import armed_condition_of, is_ever_active
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

_MOST_LISTED_PLACES = 20  # places listed in a finding
_UNREACHED_REMEDY = (
    "faults there are never active: anchor them elsewhere, or add a scenario that reaches these statements"
)
_ELSEWHERE_TEXTS = {
    Reach.BEFORE_RUN: "run only before the first observation",
    Reach.IN_CHILD: "run only in a child process",
    Reach.REPLACED: "belong to a function that another replaces",
}


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
        self.counting_mutant, self.location_by_id = build_counting_mutant(
            manifest, workspace.fault_models(), [statement.location for statement in statements]
        )
        self._last_reach: dict[FaultLocation, PlaceReach] = {}  # of statements that no run has executed
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
        job: Job,
        result: JobResult,
    ) -> None:
        """Remove the statements and triggers that a watched run of the counting mutant reached.

        A statement is removed only if the run had the changes that its fault needs.
        """
        self._scenarios_run.append("+".join((scenario, *changes)))
        executed = set()
        for name, location in self.location_by_id.items():
            place = reach_of_place(self._manifest, job, result, name, location)
            if place.reach is Reach.IN_RUN:
                executed.add(location)
            elif place.reach is not Reach.NEVER or location not in self._last_reach:
                self._last_reach[location] = place
        self.unexecuted_statements = [
            statement
            for statement in self.unexecuted_statements
            if statement.location not in executed or not set(statement.changes) <= set(changes)
        ]
        rows = np.array(list(result.watch_report.get("seen", ())), dtype=float)
        self.unreached_triggers = [
            statement
            for statement in self.unreached_triggers
            if not is_ever_active(self._condition_by_trigger[statement.trigger], rows)
        ]

    def findings(self) -> list[Finding]:
        return [
            *self._statement_findings(),
            self._reach_finding(
                "trigger",
                self._trigger_count,
                [statement.place for statement in self.unreached_triggers],
                "faults with such a trigger are never active: add a scenario in which it holds, or remove "
                "it from the campaigns",
            ),
        ]

    def _statement_findings(self) -> Iterator[Finding]:
        """Yield a finding on statements that no run reaches, and one for each other reason."""
        never = {Reach.NEVER, Reach.NOT_IMPORTED}
        reaches = {statement: self._reach_of(statement) for statement in self.unexecuted_statements}
        unreached = [
            replace(
                s.place,
                what=f"{s.place.what}: {place.text}" if place.reach is not Reach.NEVER else s.place.what,
            )
            for s, place in reaches.items()
            if place.reach in never
        ]
        elsewhere = [(s, place) for s, place in reaches.items() if place.reach not in never]
        if unreached or not elsewhere:
            yield self._reach_finding("statement", self._statement_count, unreached, _UNREACHED_REMEDY)
        for reach in dict.fromkeys(place.reach for _, place in elsewhere):
            places = [(s, place) for s, place in elsewhere if place.reach is reach]
            whole, runs = counted(self._statement_count, "statement"), ", ".join(self._scenarios_run)
            yield Finding(
                name="statements",
                level=CheckState.WARN,
                found=f"{len(places)} of {whole} {_ELSEWHERE_TEXTS[reach]} in {runs}",
                remedy="faults there are never active: anchor where the result arrives in the run",
                places=tuple(
                    replace(s.place, what=f"{s.place.what}: {place.text}")
                    for s, place in places[:_MOST_LISTED_PLACES]
                ),
            )

    def _reach_of(self, statement: SpecStatement) -> PlaceReach:
        never = PlaceReach(reach=Reach.NEVER, text="")
        return self._last_reach.get(statement.location, never)

    def _reach_finding(
        self, noun: str, count: int, unreached: Sequence[FindingPlace], remedy: str
    ) -> Finding:
        name, whole = f"{noun}s", counted(count, noun)
        if not unreached:
            message = f"{whole}, {'which is' if count == 1 else 'which are all'} reached" if count else "none"
            return Finding(name=name, level=CheckState.OK, found=message)
        message = f"{len(unreached)} of {whole} never reached in {', '.join(self._scenarios_run)}"
        places = tuple(unreached[:_MOST_LISTED_PLACES])
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
                at = location_of(injection, manifest, spec.source)
                key = (at, variant.changes)
                if key not in yielded:
                    yielded.add(key)
                    anchor = f"{at.anchor.kind.value} {at.anchor.name}".strip()
                    what = f"{spec.name}/{variant.name}: {at.path}, {at.function}, {anchor}"
                    place = FindingPlace(
                        file=str(spec.path), line=spec.source.line_of(injection.keys), what=what
                    )
                    yield SpecStatement(location=at, place=place, changes=variant.changes)


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
