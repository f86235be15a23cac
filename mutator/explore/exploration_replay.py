"""Replays an exploration from its run folder: its proposals must follow from the records."""

import json
import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

from mutator._common.message_text import counted
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.exploration_section import ExplorationSection
from mutator.errors import MutatorError
from mutator.explore.cell_results import Drive, end_of_observation
from mutator.explore.challengers import challenger_of, name_with_form
from mutator.explore.envelope import Envelope
from mutator.explore.exploration import BatchLoop, BatchProposer, Exploration, Proposal, reason_of_batch
from mutator.explore.finding_search import FindingSearch
from mutator.explore.golden_drives import drive_of, load_observed_values
from mutator.explore.planned_faults import PlannedFaults
from mutator.families.family import argument_of
from mutator.model import AfterHazard, Experiment, Hold, Method, Record, Status
from mutator.store import plan_file
from mutator.store.golden_runs import GoldenRun
from mutator.store.plan_file import BATCHES_FILE, EXPERIMENTS_FILE
from mutator.store.plan_lines import read_plan_lines
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import named_with_hold, trigger_at_time, trigger_time_s

# spec, value, scenario, start, duration, seed, end: what tells experiments of an exploration apart
_CellKey = tuple[str, object, str, float | None, float | None, int, float | None]
_GoldenKey = tuple[str, str, int]  # spec, scenario, seed
_NO_DRIVE = Drive(start_s=0.0, end_s=0.0, step_s=1.0)  # of planes without an experiment
_REMEDY = "somebody edited the plan, a record or a golden run: restore the run folder from a copy of it"


@dataclass(frozen=True)
class ExplorationReplay:
    """An exploration as its plan and records give it, up to the last batch whose records are complete.

    `differences` are where the plan does not follow from the records; nothing after the first is replayed.
    """

    exploration: Exploration | FindingSearch
    differences: tuple[MutatorError, ...] = ()
    is_cut_off: bool = False  # the next batch has no records

    @cached_property
    def envelopes(self) -> list[Envelope]:
        """The envelopes of the planes in which anything was driven; none if the goal is to find faults."""
        if isinstance(self.exploration, FindingSearch):
            return []
        return [Envelope(plane) for plane in self.exploration.planes if plane.map.results]

    @cached_property
    def unfinished_count(self) -> int:
        """The number of planes that are not searched to the end, or not validated to the end."""
        if isinstance(self.exploration, FindingSearch):
            return 0
        return sum(not plane.is_complete for plane in self.exploration.planes)

    @property
    def note(self) -> str:
        """What is unfinished, in words; empty if nothing is."""
        if isinstance(self.exploration, FindingSearch):
            return "unfinished: the search goes on" if self.is_cut_off else ""
        count = self.unfinished_count
        verb = "is" if count == 1 else "are"
        return f"unfinished: {counted(count, 'plane')} {verb} not searched to the end" if count else ""


def is_exploration(folder: RunFolder) -> bool:
    """Whether a run folder is that of an exploration. MutatorError if its `campaign.yaml` is damaged."""
    return folder.is_bench and load_campaign_of_run(folder).exploration is not None


def replay_exploration(folder: RunFolder, manifest: TargetManifest) -> ExplorationReplay:
    """Replay the exploration of a run folder; no library is needed.

    MutatorError if it has none, if the plan, a record or a golden run is damaged, and if a golden run never
    reaches a start.
    """
    campaign = load_campaign_of_run(folder)
    if campaign.exploration is None:
        raise MutatorError("no exploration", where=campaign.path, expected="a bench with the key `explore`")
    _check_lattices(campaign.exploration, campaign.path)
    check_ends(folder, campaign.after_hazard)
    plan = _ExploredPlan(folder, campaign.after_hazard, manifest.step_s)
    drives = _drives_of_planes(manifest, campaign.exploration, plan)
    proposer = FindingSearch if campaign.exploration.goal == "find" else Exploration
    exploration = proposer(section=campaign.exploration, drives=drives, seed=campaign.seed)
    replayed_plan = _ReplayedPlan(plan, exploration)
    BatchLoop(
        exploration=exploration,
        begin=replayed_plan.begin,
        finish=replayed_plan.finish,
        may_begin=replayed_plan.may_begin,
    ).run()
    return ExplorationReplay(
        exploration, tuple(replayed_plan.differences()), is_cut_off=replayed_plan.is_cut_off
    )


def check_ends(folder: RunFolder, after_hazard: AfterHazard) -> None:
    """Raise MutatorError for an exploration by an earlier version, whose runs end with their scenarios."""
    if after_hazard is AfterHazard.GO_ON:
        return
    for number, experiment in enumerate(plan_file.iterate_experiments(folder.path), 1):
        if experiment.end_s is None:
            raise MutatorError(
                f"experiment {experiment.id} ends with its scenario",
                where=folder.path / EXPERIMENTS_FILE,
                line=number,
                expected="an end soon after the fault, as in explorations by this version of mutator",
                remedy="explore anew, into another folder",
            )


def _check_lattices(section: ExplorationSection, path: Path) -> None:
    """Raise MutatorError for a lattice that no command writes."""
    for plane in section.planes:
        for name in plane.challengers:
            challenger_of(name)
        sign = math.copysign(1.0, (*plane.magnitudes, 1.0)[0])
        for values in ([sign * value for value in plane.magnitudes], plane.durations_s):
            if not all(0.0 < a < b < math.inf for a, b in pairwise([*values, sys.float_info.max])):
                raise MutatorError(
                    f"{plane.spec} in {plane.scenario}: {values[:5]} ...",
                    where=path,
                    expected="magnitudes of one sign by size, and durations, each once",
                    remedy=_REMEDY,
                )


class _ExploredPlan:
    """The plan of a run folder: experiments by what their cells say, and batches."""

    def __init__(self, folder: RunFolder, after_hazard: AfterHazard, step_s: float) -> None:
        self.folder, self.after_hazard = folder, after_hazard
        self.ids: list[str] = []
        self.keys: list[_CellKey] = []
        self.golden_by_key: dict[_GoldenKey, GoldenRun] = {}
        faults = PlannedFaults(step_s)
        for position, experiment in enumerate(plan_file.iterate_experiments(folder.path)):
            faults.note(position, experiment)
            key = _key_of_experiment(experiment, after_hazard)
            self.ids.append(experiment.id)
            self.keys.append(key)
            self.golden_by_key.setdefault((key[0], key[2], key[5]), folder.golden_run_of(experiment))
        self.wrong_faults = frozenset(faults.wrong_positions())
        for problem in plan_file.batch_problems(folder.path, len(self.ids)):
            raise problem
        self.batches = [json.loads(line) for line in read_plan_lines(folder.path / BATCHES_FILE)]
        self.records: Mapping[str, Record] = folder.records()

    def final_record(self, experiment_id: str) -> Record | None:
        record = self.records.get(experiment_id)
        return None if record is None or record.status is Status.HARNESS_ERROR else record


class _ReplayedPlan:
    """Compares the batches that an exploration proposes with those of a plan, one after another."""

    def __init__(self, plan: _ExploredPlan, exploration: BatchProposer) -> None:
        self._plan, self._exploration = plan, exploration
        self._id_by_key: dict[_CellKey, str] = {}
        self._line, self._position, self._number = 0, 0, 0
        self._difference: MutatorError | None = None
        self.is_cut_off = False

    def may_begin(self, batch: Sequence[Proposal]) -> bool:
        """Return whether the plan has this batch, with all records."""
        new_keys = [key for key in dict.fromkeys(map(self._key, batch)) if key not in self._id_by_key]
        if new_keys and self._line == len(self._plan.batches):
            self.is_cut_off = True
            return False
        self._difference = self._difference_of_next_batch(new_keys) if new_keys else None
        if self._difference is not None:
            return False
        new_ids = self._plan.ids[self._position : self._position + len(new_keys)]
        earlier_ids = [self._id_by_key[key] for key in map(self._key, batch) if key in self._id_by_key]
        self.is_cut_off = any(self._plan.final_record(name) is None for name in (*new_ids, *earlier_ids))
        if self.is_cut_off:
            return False
        self._id_by_key |= zip(new_keys, new_ids, strict=True)
        return True

    def begin(self, number: int, batch: Sequence[Proposal]) -> None:
        planned_count = len(self._id_by_key)
        self._line += planned_count > self._position
        self._position, self._number = planned_count, number

    def finish(self, batch: Sequence[Proposal]) -> Iterable[Record]:
        return [self._plan.records[self._id_by_key[self._key(proposal)]] for proposal in batch]

    def differences(self) -> Iterator[MutatorError]:
        if self._difference is not None:
            yield self._difference
        elif not self.is_cut_off and self._line < len(self._plan.batches):
            yield self._batch_error(
                "a batch more than the records give", "no further batch: all planes are complete"
            )

    def _difference_of_next_batch(self, keys: list[_CellKey]) -> MutatorError | None:
        batch = self._plan.batches[self._line]
        if batch["experiments"] != len(keys):
            return self._batch_error(
                f"a batch of {counted(batch['experiments'], 'experiment')}",
                f"{len(keys)}, which follow from the records",
            )
        reason = reason_of_batch(self._number + 1)
        if batch["reason"] != reason:
            return self._batch_error(f"reason '{batch['reason']}'", f"'{reason}'")
        planned = self._plan.keys[self._position : self._position + len(keys)]
        for number, (got, expected) in enumerate(zip(planned, keys, strict=True), self._position + 1):
            if got != expected:
                return self._experiment_error(
                    number, _cell_text(got), f"{_cell_text(expected)}, which follows from the records"
                )
            if number - 1 in self._plan.wrong_faults:
                return self._experiment_error(
                    number,
                    f"{_cell_text(got)} injects another fault",
                    "that of its name, which follows from the others of this variant",
                )
        return None

    def _experiment_error(self, number: int, got: str, expected: str) -> MutatorError:
        where = self._plan.folder.path / EXPERIMENTS_FILE
        return MutatorError(got, where=where, line=number, expected=expected, remedy=_REMEDY)

    def _batch_error(self, got: str, expected: str) -> MutatorError:
        where = self._plan.folder.path / BATCHES_FILE
        return MutatorError(got, where=where, line=self._line + 1, expected=expected, remedy=_REMEDY)

    def _key(self, proposal: Proposal) -> _CellKey:
        section, (line, duration) = self._exploration.section, proposal.cell
        plane, start_s = section.planes[proposal.plane], self._exploration.drives[proposal.plane].start_s
        duration_s = plane.durations_s[duration]
        ends_early = self._plan.after_hazard is AfterHazard.STOP
        return (
            name_with_form(plane.spec, proposal.form),
            plane.magnitudes[line] if plane.magnitudes else None,
            _scenario_key(plane.scenario),
            start_s,
            duration_s,
            plane.seed,
            end_of_observation(start_s, duration_s, section.observe_s) if ends_early else None,
        )


def _key_of_experiment(experiment: Experiment, after_hazard: AfterHazard) -> _CellKey:
    trigger, start_s = experiment.trigger, trigger_time_s(experiment.trigger)
    is_from_time_on = (
        start_s is not None
        and trigger == named_with_hold(trigger_at_time(start_s, hold_s=trigger.hold_s))
        and trigger.hold is Hold.FOR
        and experiment.method is Method.GUIDED
        and not experiment.setting
        and experiment.after_hazard is after_hazard
    )
    return (
        experiment.fault.spec,
        experiment.fault.value,
        _scenario_key(argument_of(experiment.concrete) if experiment.concrete else experiment.scenario),
        start_s if is_from_time_on else None,
        trigger.hold_s,
        experiment.seed,
        experiment.end_s,
    )


def _scenario_key(scenario: str) -> str:
    """Return a scenario's name, or family and values in one order: a plan sorts them by name."""
    family, _, values = scenario.partition(":")
    return f"{family}:{','.join(sorted(values.split(',')))}" if values else scenario


def _cell_text(key: _CellKey) -> str:
    spec, value, scenario, start_s, duration_s, seed, end_s = key
    what = spec if value is None else f"{spec} {value}"
    end = "" if end_s is None else f", up to {end_s} s"
    return f"{what} in {scenario} from {start_s} s for {duration_s} s{end}, seed {seed}"


def _drives_of_planes(
    manifest: TargetManifest, section: ExplorationSection, plan: _ExploredPlan
) -> list[Drive]:
    drives = [_NO_DRIVE] * len(section.planes)
    numbers_by_golden: dict[GoldenRun, list[int]] = {}
    for number, plane in enumerate(section.planes):
        golden = plan.golden_by_key.get((plane.spec, _scenario_key(plane.scenario), plane.seed))
        if golden is not None:
            numbers_by_golden.setdefault(golden, []).append(number)
    for golden, numbers in numbers_by_golden.items():  # one golden run at a time in memory
        observed = load_observed_values(manifest, plan.folder.golden_folder(*golden))
        for number in numbers:
            drives[number] = drive_of(manifest, observed, section.planes[number])
    return drives
