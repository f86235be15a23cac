"""Check a target by running it: `mutator check --drive`.

Each scenario runs twice without a fault, with two hash seeds. In the second run, a probe counts how often
each statement that a fault spec names executes, and calls that can make runs differ are noted. If the runs
differ, further runs show the cause.
"""

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mutator._common.confined_files import inside
from mutator._common.cpu_cores import usable_cores
from mutator._common.files import ScratchFolder
from mutator.campaigns.campaign_expansion import Expansion
from mutator.campaigns.campaign_files import Campaign, load_campaign
from mutator.checks import fast_engine_check, nondeterminism_causes
from mutator.checks.findings import Finding, Level
from mutator.checks.first_difference import describe_first_difference
from mutator.checks.reachability import Reach
from mutator.engines import forkable
from mutator.engines.engine_jobs import Execution, Job
from mutator.engines.fork_engine import ForkEngine
from mutator.engines.in_target.nondeterminism_watch import CLOCK, THREAD
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.thread_messages import too_many, turned_off
from mutator.errors import NotForkable
from mutator.model import Experiment, Limits
from mutator.mutants.injected_lines import tag_of
from mutator.mutants.mutant_building import build
from mutator.mutants.probe import is_probe
from mutator.preflight import canary
from mutator.preflight.preflight_rules import CheckRun, judge_golden, judge_null, look
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always
from mutator.workspace import Workspace

_OTHER_HASH_SEED = 4242
_BRIEF_S = 5.0  # slower golden runs are not repeated for the fast engines
_MOST = 20  # places listed in a finding


def check_drive(workspace: Workspace, target: str, scenarios: Sequence[str] = ()) -> list[Finding]:
    """Return the findings from golden runs of the scenarios (default: those of the target's campaigns, or
    else all).

    The findings cover differences between equal runs (and likely causes), obstacles to forking, statements of
    fault specs that never run, triggers that never hold, and harmless canaries. Raises MutatorError for an
    unknown scenario or a mistake in the library; `check_library` reports all such mistakes.
    """
    with ScratchFolder("mutator-drive-") as scratch:
        return _Drive(workspace, target, scenarios, scratch).findings()


@dataclass(frozen=True)
class _Golden:
    """The runs of a scenario.

    `first` runs the pristine target, and `watched` the counting mutant with another hash seed. `again` runs
    the pristine target with that seed; if no third run is needed, it is `watched`.
    """

    first: Execution
    watched: Execution
    again: Execution


class _Drive:
    def __init__(self, workspace: Workspace, target: str, scenarios: Sequence[str], scratch: Path) -> None:
        self.workspace = workspace
        self.manifest: TargetManifest = workspace.manifest(target)
        loaded = [load_campaign(workspace.campaign(name)) for name in workspace.campaigns]
        mine = [campaign for campaign in loaded if campaign.target == self.manifest.name]
        used = dict.fromkeys(name for campaign in mine for name in campaign.scenarios)
        self.scenarios = list(dict.fromkeys(scenarios)) or list(used) or list(workspace.scenarios)
        for name in self.scenarios:
            workspace.scenario(name)
        self.campaigns = [one for one in mine if set(one.scenarios) & set(self.scenarios)]
        self.reach = Reach(workspace, self.manifest, self.campaigns)
        settings = [_setting(workspace, campaign) for campaign in self.campaigns] or [()]
        self.setting = () if () in settings else settings[0]
        self.settings = list(dict.fromkeys(settings))
        limits = self.campaigns[0].limits if self.campaigns else Limits()
        self.seed = self.campaigns[0].seed if self.campaigns else 0
        self._scratch = scratch
        work = scratch / "work"
        work.mkdir()
        self.engine = ReferenceEngine(self.manifest, work, limits)

    def findings(self) -> list[Finding]:
        with ThreadPoolExecutor(usable_cores()) as pool:
            jobs = [job for name in self.scenarios for job in self._jobs(name)]
            runs = dict(zip((job.name for job in jobs), pool.map(self._run, jobs), strict=True))
            goldens = {name: self._golden(name, runs) for name in self.scenarios}
            found = [self._determinism(name, golden) for name, golden in goldens.items()]
            if all(self._look(golden.first).problem for golden in goldens.values()):
                return found  # failed runs allow no further findings
            found += self._clocks(goldens) if all(one.level is Level.OK for one in found) else []
            found.append(self._forking(goldens, well=found[0].level is Level.OK))
            for name, golden in goldens.items():
                self._take(name, self.setting, golden.watched)
            canaries = pool.map(self._canary, self._canaries())
            self._reach_more()
            return [*found, *self.reach.findings(), *canaries]

    # Runs

    def _jobs(self, scenario: str) -> Iterator[Job]:
        yield self._job("first", scenario, self.setting)
        yield self._counting(scenario, self.setting)

    def _golden(self, scenario: str, runs: Mapping[str, Execution]) -> _Golden:
        first, watched = runs[f"first-{scenario}"], runs[f"counting-{scenario}"]
        one, other = self._look(first), self._look(watched)
        if one.problem or (one.digest == other.digest and not other.problem):
            return _Golden(first, watched, watched)
        again = replace(self._job("again", scenario, self.setting), hash_seed=_OTHER_HASH_SEED)
        if other.problem:  # watching might be the cause
            counting = self._counting(scenario, self.setting)
            watched = self._run(replace(counting, name=f"unwatched-{scenario}", watch=False))
        return _Golden(first, watched, self._run(again))

    def _job(self, kind: str, scenario: str, changes: tuple[str, ...]) -> Job:
        file = self.workspace.scenario(scenario)
        return Job(name=f"{kind}-{scenario}", scenario=file, seed=self.seed, changes=changes)

    def _counting(self, scenario: str, changes: tuple[str, ...]) -> Job:
        mutant = self.reach.counting
        return replace(
            self._job("counting", scenario, changes),
            files=mutant.files,
            mutant=mutant.id,
            injections=mutant.injections,
            hash_seed=_OTHER_HASH_SEED,
            watch=True,
        )

    def _run(self, job: Job) -> Execution:
        folder = inside(self.engine.work, f"{job.name}-{'-'.join(job.changes)}")
        return self.engine.execute(job, folder)

    def _look(self, execution: Execution) -> CheckRun:
        return look(self.manifest, execution)

    # Determinism

    def _determinism(self, scenario: str, golden: _Golden) -> Finding:
        """Check that the runs give the same bytes and reach no hazard."""
        name = f"golden {scenario}"
        first, watched, again = (self._look(one) for one in (golden.first, golden.watched, golden.again))
        problem = judge_golden(first, again)
        if not problem and not (problem := judge_null(first, watched)):
            found = f"the same bytes twice, in {golden.first.wall_s:.1f} s each"
            return Finding(name=name, level=Level.OK, found=found)
        if first.problem or again.problem or watched.problem or first.digest == again.digest:
            remedy = "fix the target, the scenario or the manifest: no campaign can start"
            return Finding(name=name, level=Level.FAIL, found=problem, remedy=remedy)
        same = self._look(self._run(self._job("same", scenario, self.setting)))
        return self._not_deterministic(name, golden, by_hash=same.digest == first.digest)

    def _not_deterministic(self, name: str, golden: _Golden, *, by_hash: bool) -> Finding:
        where = describe_first_difference(self.manifest, golden.first.out, golden.again.out)
        places, remedy = nondeterminism_causes.likely(self.manifest, self._noted(golden), by_hash=by_hash)
        which = ", but only if their hash seeds differ" if by_hash else ""
        likely = f"; likely {'cause' if len(places) == 1 else 'causes'}:" if places else ""
        return Finding(
            name=name,
            level=Level.FAIL,
            found=f"two runs differ{which}; they first differ {where}{likely}",
            places=tuple(places),
            remedy=remedy,
        )

    def _noted(self, golden: _Golden) -> dict[str, Any]:
        """Return the notes of the watched run, with the target's own line numbers."""
        files = self.reach.counting.files
        noted = [
            one
            | {"line": _own_line(files[one["file"]], one["line"]) if one["file"] in files else one["line"]}
            for one in golden.watched.watched.get("noted", ())
            if not is_probe(one["file"])
        ]
        return {**golden.watched.watched, "noted": noted}

    def _clocks(self, goldens: Mapping[str, _Golden]) -> list[Finding]:
        noted = [
            place
            for golden in goldens.values()
            for place in nondeterminism_causes.of_kind(self._noted(golden), CLOCK)
        ]
        if not noted:
            return []
        found = "the target reads clocks, but neither trace nor record depends on them"
        return [
            Finding(name="clocks", level=Level.OK, found=found, places=tuple(dict.fromkeys(noted))[:_MOST])
        ]

    # Fast engines

    def _forking(self, goldens: Mapping[str, _Golden], *, well: bool) -> Finding:
        """Report whether a golden run can be forked between its steps.

        This is tried only if the run is fast and deterministic (`well`); otherwise, only its threads are
        checked.
        """
        scenario, golden = next(iter(goldens.items()))
        tried = well and golden.first.wall_s <= _BRIEF_S
        refusal = forkable.unfit(self.manifest)
        if not refusal:
            refusal = self._refusal(scenario, golden) if tried else _threads(golden.watched)
        if refusal is None and not tried:
            why = (
                f"because a golden run takes {golden.first.wall_s:.0f} s"
                if well
                else "because a golden run fails or is not deterministic"
            )
            found = f"no threads prevent forking; forking was not tried, {why}"
            return Finding(name=fast_engine_check.NAME, level=Level.OK if well else Level.WARN, found=found)
        told = fast_engine_check.finding(refusal)
        if refusal is None or "thread" not in str(refusal):
            return told
        noted = [self._noted(one) for one in goldens.values()]
        places = dict.fromkeys(place for one in noted for place in nondeterminism_causes.of_kind(one, THREAD))
        return replace(told, places=tuple(places))

    def _refusal(self, scenario: str, golden: _Golden) -> NotForkable | None:
        null = build(self.manifest, self.workspace.fault_models(), None, always())
        work = self._scratch / "fork"
        work.mkdir()
        fork = ForkEngine(self.manifest, work, self.engine.limits, null=null)
        try:
            return fork.refusal(replace(self._job("fork", scenario, self.setting), golden=golden.first.out))
        finally:
            fork.close()

    # Statements and triggers

    def _take(self, scenario: str, changes: tuple[str, ...], execution: Execution) -> None:
        self.reach.take(scenario, changes, execution.probe, execution.watched.get("seen", ()))

    def _reach_more(self) -> None:
        """Run with the changes that faults and campaigns make, until every statement and trigger is reached
        or no changes are left.
        """
        own = list(dict.fromkeys(one.changes for one in self.reach.unexecuted if one.changes))
        for changes in own:
            for scenario in self.scenarios:
                if any(one.changes == changes for one in self.reach.unexecuted):
                    self._drive_on(scenario, (*changes, *self.setting))
        for setting in self.settings:
            left = [one.changes for one in self.reach.unexecuted] + [()] * bool(self.reach.untriggered)
            for changes in dict.fromkeys(left):
                if setting != self.setting:
                    self._drive_on(self.scenarios[0], (*changes, *setting))

    def _drive_on(self, scenario: str, changes: tuple[str, ...]) -> None:
        changes = tuple(dict.fromkeys(changes))
        self._take(scenario, changes, self._run(self._counting(scenario, changes)))

    # Canaries

    def _canaries(self) -> list[tuple[str, Experiment, str]]:
        """Campaign, canary and hazard. Canaries that differ only in their setting are tried once."""
        found: dict[object, tuple[str, Experiment, str]] = {}
        for campaign in sorted(self.campaigns, key=lambda one: len(_setting(self.workspace, one))):
            reading = _reading(self.workspace, campaign)
            if campaign.canary not in found and campaign.canary.scenario in self.scenarios:
                made = Expansion(self.workspace, campaign, self.manifest, campaign.seed, reading).canary()
                found[campaign.canary] = (campaign.name, made, campaign.canary.hazard)
        return list(found.values())

    def _canary(self, one: tuple[str, Experiment, str]) -> Finding:
        campaign, experiment, hazard = one

        def run(tried: Experiment) -> CheckRun:
            return self._look(self._run(canary.job(self.workspace, self.manifest, tried)))

        problem, found = canary.judge(canary.tries(self.workspace, self.manifest, experiment), run, hazard)
        return Finding(
            name=f"canary {campaign}",
            level=Level.FAIL if problem else Level.OK,
            found=f"{experiment.fault.spec} in {experiment.scenario} {problem or found}",
            remedy="choose another fault, an earlier time or another scenario for `canary`"
            if problem
            else "",
        )


def _threads(watched: Execution) -> NotForkable | None:
    others = watched.watched.get("threads", [])
    return NotForkable(too_many(others), turned_off(others)) if others else None


def _reading(workspace: Workspace, campaign: Campaign) -> str:
    return campaign.reading or workspace.readings().default


def _setting(workspace: Workspace, campaign: Campaign) -> tuple[str, ...]:
    return campaign.setting_in(_reading(workspace, campaign))


def _own_line(data: bytes, line: int) -> int:
    """Convert a line number in a mutant's file to the one in the target's own file."""
    tags = map(tag_of, data.splitlines()[: line - 1])
    return line - sum(tag is not None and tag.was is None for tag in tags)
