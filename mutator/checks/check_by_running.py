"""Check a target by running it: `mutator check --drive`.

Each scenario runs twice without a fault, with two hash seeds. In the second run, a probe counts how often
each statement that a fault spec names executes, and calls that can make runs differ are noted. If the runs
differ, further runs show the cause.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.cpu_cores import usable_cores
from mutator._common.files import ScratchFolder
from mutator.campaigns.campaign_expansion import CampaignExpansion
from mutator.campaigns.campaign_files import Campaign, load_campaign
from mutator.checks import fast_engine_check, nondeterminism_suspects
from mutator.checks.check_findings import CheckState, Finding, golden_hazard_finding
from mutator.checks.first_run_difference import describe_first_difference
from mutator.checks.reached_statements_and_triggers import ReachTracker
from mutator.checks.unloaded_files import unloaded_files_findings
from mutator.engines import forkable
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.fork_engine import ForkEngine
from mutator.engines.in_target.nondeterminism_watch import CLOCK, THREAD
from mutator.engines.reach_jobs import watched_job
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.run_limits import limits_before_measuring, measure_limits
from mutator.errors import NotForkable
from mutator.limits import Limits
from mutator.model import Experiment
from mutator.mutants.injected_line_syntax import target_line_of
from mutator.mutants.mutant_building import build
from mutator.mutants.probe_contract import is_probe_path
from mutator.preflight import canary_check
from mutator.preflight.check_run_problems import (
    CheckRun,
    golden_pair_problem,
    null_mutant_problem,
    read_check_run,
)
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

_OTHER_HASH_SEED = 4242  # any but 0, the seed of ordinary runs
_MOST_REPEATED_RUN_S = 5.0  # of CPU; slower golden runs are not repeated for the fast engines
_MOST_LISTED_PLACES = 20  # places listed in a finding


def findings_from_running(workspace: Workspace, target: str, scenarios: Sequence[str] = ()) -> list[Finding]:
    """Return the findings from golden runs of the scenarios (default: those of the target's campaigns, or
    else all).

    The findings cover differences between equal runs (and likely causes), obstacles to forking, statements of
    fault specs that never run, triggers that never hold, and harmless canaries. Raises MutatorError for an
    unknown scenario or a mistake in the library; `library_problems` reports all such mistakes.
    """
    with ScratchFolder("mutator-drive-") as scratch:
        return _RunningCheck(workspace, target, scenarios, scratch).findings()


@dataclass(frozen=True)
class _GoldenRuns:
    """The runs of a scenario.

    `first` runs the pristine target, and `watched_counting` the counting mutant with another hash seed.
    `again` runs the pristine target with that seed; if no third run is needed, it is `watched_counting`.
    """

    first: JobResult
    watched_counting: JobResult
    again: JobResult


@dataclass(frozen=True, kw_only=True)
class _CanaryToTry:
    """A campaign's canary, its hazard, and the limits of its runs."""

    campaign: str
    experiment: Experiment
    hazard: str
    limits: Limits


class _RunningCheck:
    def __init__(self, workspace: Workspace, target: str, scenarios: Sequence[str], scratch: Path) -> None:
        self.workspace = workspace
        self.manifest: TargetManifest = workspace.manifest(target)
        campaigns = [load_campaign(workspace.campaign(name)) for name in workspace.campaigns]
        target_campaigns = [campaign for campaign in campaigns if campaign.target == self.manifest.name]
        used = dict.fromkeys(name for campaign in target_campaigns for name in campaign.scenarios)
        self.scenarios = list(dict.fromkeys(scenarios)) or list(used) or list(workspace.scenarios)
        for name in self.scenarios:
            workspace.scenario(name)
        self.campaigns = [c for c in target_campaigns if set(c.scenarios) & set(self.scenarios)]
        self.reach_tracker = ReachTracker(workspace, self.manifest, self.campaigns)
        settings = [_campaign_changes(workspace, campaign) for campaign in self.campaigns] or [()]
        self.usual_changes = () if () in settings else settings[0]
        self.changes_of_campaigns = list(dict.fromkeys(settings))
        limits = self.campaigns[0].golden_run_limits if self.campaigns else limits_before_measuring(Limits())
        self.seed = self.campaigns[0].seed if self.campaigns else 0
        self._scratch = scratch
        self._run_numbers = itertools.count()
        work = scratch / "work"
        work.mkdir()
        self.engine = ReferenceEngine(self.manifest, work, limits)

    def findings(self) -> list[Finding]:
        with ThreadPoolExecutor(usable_cores()) as pool:
            jobs = [job for name in self.scenarios for job in self._first_jobs(name)]
            runs = dict(zip((job.name for job in jobs), pool.map(self._execute, jobs), strict=True))
            goldens = {name: self._complete_golden_runs(name, runs) for name in self.scenarios}
            findings = [self._golden_runs_finding(name, golden) for name, golden in goldens.items()]
            if all(self._check_run(golden.first).problem for golden in goldens.values()):
                return findings  # failed runs allow no further findings
            findings += (
                self._clock_findings(goldens)
                if not any(finding.level is CheckState.FAIL for finding in findings)
                else []
            )
            findings.append(
                self._forking_finding(goldens, is_deterministic=findings[0].level is not CheckState.FAIL)
            )
            for name, golden in goldens.items():
                self._record_reach(name, self.usual_changes, golden.watched_counting)
            golden_cpu_s = [golden.first.cpu_s for golden in goldens.values()]
            canaries = pool.map(self._canary_finding, self._distinct_canaries(golden_cpu_s))
            self._run_with_further_changes()
            tree = self.manifest.tree
            loaded = {f for g in goldens.values() for f in g.watched_counting.reach_report.get("loaded", ())}
            findings += unloaded_files_findings(tree.files.keys() - tree.overlaid_paths, loaded)
            return [*findings, *self.reach_tracker.findings(), *canaries]

    # Runs

    def _first_jobs(self, scenario: str) -> Iterator[Job]:
        yield self._pristine_job("first", scenario, self.usual_changes)
        yield self._counting_job(scenario, self.usual_changes)

    def _complete_golden_runs(self, scenario: str, runs: Mapping[str, JobResult]) -> _GoldenRuns:
        first, watched = runs[f"first-{scenario}"], runs[f"counting-{scenario}"]
        first_run, watched_run = self._check_run(first), self._check_run(watched)
        if first_run.problem or (
            first_run.output_digest == watched_run.output_digest and not watched_run.problem
        ):
            return _GoldenRuns(first, watched, watched)
        again = replace(self._pristine_job("again", scenario, self.usual_changes), hash_seed=_OTHER_HASH_SEED)
        if watched_run.problem:  # watching might be the cause
            counting = self._counting_job(scenario, self.usual_changes)
            watched = self._execute(
                replace(counting, name=f"unwatched-{scenario}", watch_nondeterminism=False)
            )
        return _GoldenRuns(first, watched, self._execute(again))

    def _pristine_job(self, kind: str, scenario: str, changes: tuple[str, ...]) -> Job:
        file = self.workspace.scenario(scenario)
        return Job(name=f"{kind}-{scenario}", scenario=file, seed=self.seed, scenario_changes=changes)

    def _counting_job(self, scenario: str, changes: tuple[str, ...]) -> Job:
        mutant = self.reach_tracker.counting_mutant
        job = replace(
            self._pristine_job("counting", scenario, changes),
            changed_files=mutant.files,
            mutant_id=mutant.id,
            injection_ids=mutant.injection_ids,
            ids_before_anchor=mutant.ids_before_anchor,
            hash_seed=_OTHER_HASH_SEED,
            watch_nondeterminism=True,
        )
        return watched_job(job, self.reach_tracker.location_by_id)

    def _execute(self, job: Job) -> JobResult:
        return self.engine.execute(job, self._new_run_folder(job))

    def _new_run_folder(self, job: Job) -> Path:
        # numbered, because the same job can run again, and two campaigns can have the same canary
        return path_below(self.engine.work_folder, f"{next(self._run_numbers)}-{job.name}")

    def _check_run(self, execution: JobResult) -> CheckRun:
        return read_check_run(self.manifest, execution)

    # Determinism

    def _golden_runs_finding(self, scenario: str, golden: _GoldenRuns) -> Finding:
        """Check that the runs give the same bytes. A hazard is a warning."""
        name = f"golden {scenario}"
        first, watched, again = (
            self._check_run(execution) for execution in (golden.first, golden.watched_counting, golden.again)
        )
        problem = golden_pair_problem(first, again)
        if not problem and not (problem := null_mutant_problem(first, watched)):
            success = f"the same bytes twice, in {golden.first.cpu_s:.1f} s of CPU each"
            if first.hazards:
                return golden_hazard_finding(name, success, first.hazards)
            return Finding(name=name, level=CheckState.OK, found=success)
        if first.problem or again.problem or watched.problem or first.output_digest == again.output_digest:
            remedy = "fix the target, the scenario or the manifest: no campaign can start"
            return Finding(name=name, level=CheckState.FAIL, found=problem, remedy=remedy)
        same = self._check_run(self._execute(self._pristine_job("same", scenario, self.usual_changes)))
        return self._nondeterminism_finding(
            name, golden, depends_on_hash_seed=same.output_digest == first.output_digest
        )

    def _nondeterminism_finding(
        self, name: str, golden: _GoldenRuns, *, depends_on_hash_seed: bool
    ) -> Finding:
        where = describe_first_difference(self.manifest, golden.first.out, golden.again.out)
        places, remedy = nondeterminism_suspects.likely_places_and_remedies(
            self.manifest, self._notes_with_target_lines(golden), depends_on_hash_seed=depends_on_hash_seed
        )
        which = ", but only if their hash seeds differ" if depends_on_hash_seed else ""
        likely = f"; likely {'cause' if len(places) == 1 else 'causes'}:" if places else ""
        return Finding(
            name=name,
            level=CheckState.FAIL,
            found=f"two runs differ{which}; they first differ {where}{likely}",
            places=tuple(places),
            remedy=remedy,
        )

    def _notes_with_target_lines(self, golden: _GoldenRuns) -> dict[str, Any]:
        """Return the notes of the watched run, with the target's own line numbers."""
        files = self.reach_tracker.counting_mutant.files
        noted = [
            note
            | {
                "line": target_line_of(files[note["file"]], note["line"])
                if note["file"] in files
                else note["line"]
            }
            for note in golden.watched_counting.watch_report.get("noted", ())
            if not is_probe_path(note["file"])
        ]
        return {**golden.watched_counting.watch_report, "noted": noted}

    def _clock_findings(self, goldens: Mapping[str, _GoldenRuns]) -> list[Finding]:
        places = [
            place
            for golden in goldens.values()
            for place in nondeterminism_suspects.places_of_kind(self._notes_with_target_lines(golden), CLOCK)
        ]
        if not places:
            return []
        message = "the target reads clocks, but neither trace nor record depends on them"
        return [
            Finding(
                name="clocks",
                level=CheckState.OK,
                found=message,
                places=tuple(dict.fromkeys(places))[:_MOST_LISTED_PLACES],
            )
        ]

    # Fast engines

    def _forking_finding(self, goldens: Mapping[str, _GoldenRuns], *, is_deterministic: bool) -> Finding:
        """Report whether a golden run can be forked between its steps.

        This is tried only if the run is fast and deterministic; otherwise, only its threads are checked.
        """
        scenario, golden = next(iter(goldens.items()))
        is_tried = is_deterministic and golden.first.cpu_s <= _MOST_REPEATED_RUN_S
        refusal = forkable.find_obstacle_before_loading(self.manifest)
        if not refusal:
            refusal = (
                self._forking_refusal(scenario, golden)
                if is_tried
                else fast_engine_check.forking_refusal_by_threads(golden.watched_counting)
            )
        if refusal is None and not is_tried:
            why = (
                f"because a golden run takes {golden.first.cpu_s:.0f} s of CPU"
                if is_deterministic
                else "because a golden run fails or is not deterministic"
            )
            message = f"no threads prevent forking; forking was not tried, {why}"
            return Finding(
                name=fast_engine_check.FINDING_NAME,
                level=CheckState.OK if is_deterministic else CheckState.WARN,
                found=message,
            )
        finding = fast_engine_check.forking_finding(refusal)
        if refusal is None or "thread" not in str(refusal):
            return finding
        noted = [self._notes_with_target_lines(golden_runs) for golden_runs in goldens.values()]
        places = dict.fromkeys(
            place
            for golden_runs in noted
            for place in nondeterminism_suspects.places_of_kind(golden_runs, THREAD)
        )
        return replace(finding, places=tuple(places))

    def _forking_refusal(self, scenario: str, golden: _GoldenRuns) -> NotForkable | None:
        null = build(self.manifest, self.workspace.fault_models(), None, always_trigger())
        work = self._scratch / "fork"
        work.mkdir()
        engine = ForkEngine(self.manifest, work, self.engine.limits, null_mutant=null)
        try:
            return engine.find_obstacle_in_golden_run(
                replace(
                    self._pristine_job("fork", scenario, self.usual_changes), golden_folder=golden.first.out
                )
            )
        finally:
            engine.close()

    # Statements and triggers

    def _record_reach(self, scenario: str, changes: tuple[str, ...], execution: JobResult) -> None:
        self.reach_tracker.record_run(scenario, changes, self._counting_job(scenario, changes), execution)

    def _run_with_further_changes(self) -> None:
        """Run with the changes that faults and campaigns make, until every statement and trigger is reached
        or no changes are left.
        """
        fault_changes = list(
            dict.fromkeys(
                statement.changes
                for statement in self.reach_tracker.unexecuted_statements
                if statement.changes
            )
        )
        for changes in fault_changes:
            for scenario in self.scenarios:
                if any(
                    statement.changes == changes for statement in self.reach_tracker.unexecuted_statements
                ):
                    self._run_counting_mutant(scenario, (*changes, *self.usual_changes))
        for setting in self.changes_of_campaigns:
            remaining = [statement.changes for statement in self.reach_tracker.unexecuted_statements] + [
                ()
            ] * bool(self.reach_tracker.unreached_triggers)
            for changes in dict.fromkeys(remaining):
                if setting != self.usual_changes:
                    self._run_counting_mutant(self.scenarios[0], (*changes, *setting))

    def _run_counting_mutant(self, scenario: str, changes: tuple[str, ...]) -> None:
        changes = tuple(dict.fromkeys(changes))
        self._record_reach(scenario, changes, self._execute(self._counting_job(scenario, changes)))

    # Canaries

    def _distinct_canaries(self, golden_cpu_s: Sequence[float]) -> list[_CanaryToTry]:
        """Return the canaries of the campaigns. Those that differ only in their setting are tried once."""
        canaries: dict[object, _CanaryToTry] = {}
        for campaign in sorted(self.campaigns, key=lambda c: len(_campaign_changes(self.workspace, c))):
            reading = _reading_of(self.workspace, campaign)
            if campaign.canary is None or campaign.canary in canaries:
                continue
            if campaign.canary.scenario in self.scenarios:
                experiment = CampaignExpansion(
                    self.workspace, campaign, self.manifest, campaign.seed, reading
                ).build_canary()
                assert experiment is not None  # the campaign has a canary
                canaries[campaign.canary] = _CanaryToTry(
                    campaign=campaign.name,
                    experiment=experiment,
                    hazard=campaign.canary.hazard,
                    limits=measure_limits(campaign.limits, campaign.measured_limit_names, golden_cpu_s),
                )
        return list(canaries.values())

    def _canary_finding(self, canary_to_try: _CanaryToTry) -> Finding:
        experiment = canary_to_try.experiment
        engine = ReferenceEngine(self.manifest, self.engine.work_folder, canary_to_try.limits)

        def run(tried: Experiment) -> CheckRun:
            job = canary_check.build_canary_job(self.workspace, self.manifest, tried)
            return self._check_run(engine.execute(job, self._new_run_folder(job)))

        verdict = canary_check.run_until_hazard(
            canary_check.canary_with_other_values(self.workspace, self.manifest, experiment),
            run,
            canary_to_try.hazard,
        )
        return Finding(
            name=f"canary {canary_to_try.campaign}",
            level=CheckState.FAIL if verdict.problem else CheckState.OK,
            found=f"{experiment.fault.spec} in {experiment.scenario} {verdict.problem or verdict.success}",
            remedy=verdict.remedy,
        )


def _reading_of(workspace: Workspace, campaign: Campaign) -> str:
    return campaign.reading or workspace.readings().default_name


def _campaign_changes(workspace: Workspace, campaign: Campaign) -> tuple[str, ...]:
    return campaign.changes_in(_reading_of(workspace, campaign))
