"""The bench of an exploration: how it is opened, and how the experiments of planes are built."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from mutator._common.argument_checks import check_whole_number
from mutator.api.experiments import ExperimentBuilder
from mutator.api.explored_faults import fault_builder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.campaigns.exploration_section import ExplorationSection, ExploredPlane
from mutator.engines.engine_choice import check_engine_is_offered
from mutator.execution.bench import Bench
from mutator.execution.bench_opening import finishing, opened_bench
from mutator.execution.distributor_choice import Distributor
from mutator.explore.cell_results import end_of_observation
from mutator.explore.challengers import name_with_form
from mutator.explore.envelope_files import delete_envelopes, write_envelopes
from mutator.explore.exploration import Exploration
from mutator.explore.exploration_replay import ExplorationReplay, check_ends
from mutator.explore.exploration_run import BuildExperiment, find_drives, run_exploration
from mutator.explore.finding_search import FindingSearch
from mutator.model import AfterHazard, Experiment
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.targets.early_stop_code import can_stop_at_hazard

SEARCHED_MAGNITUDES, SEARCHED_DURATIONS = 16, 9  # of a plane in a search for findings


@contextmanager
def opened_exploration(
    selected_target: SelectedTarget,
    values: Mapping[str, Any],
    section: ExplorationSection,
    out: Path,
    *,
    workers: int,
    engine: str | None,
    reuse: bool,
    distributor: Distributor | None,
    progress: ProgressCallback | None,
) -> Iterator[Bench]:
    """Open the bench of an exploration, and finish it at the end of the block."""
    check_whole_number("workers", workers, least=1)
    check_engine_is_offered(engine)
    after_hazard = after_hazard_of(selected_target)
    if RunFolder.exists(out):
        check_ends(RunFolder.open(out), after_hazard)
    values = {name: value for name, value in values.items() if name != "include"}
    values |= {"after_hazard": after_hazard.value, "explore": asdict(section)}
    with (
        opened_bench(
            selected_target.workspace,
            out,
            values,
            workers=workers,
            engine=engine,
            reuse=reuse,
            distributor=distributor,
            notify=progress,
        ) as bench,
        finishing(bench),
    ):
        yield bench


def explore_envelopes(
    bench: Bench,
    section: ExplorationSection,
    selected_target: SelectedTarget,
    reading: str,
    may_begin: Callable[[], bool],
) -> ExplorationReplay:
    """Explore the planes of a section on its open bench, and write what is survived of each."""
    build = experiment_builder(selected_target, reading, section.observe_s)
    drives = find_drives(bench, selected_target.manifest, section, build)
    exploration = Exploration(section=section, drives=drives, seed=section.planes[0].seed)
    delete_envelopes(bench.path)  # a kill must not leave those of fewer runs
    run_exploration(bench, exploration, build, may_begin)
    explored = ExplorationReplay(exploration)
    if explored.envelopes:
        write_envelopes(bench.path, explored)
    return explored


def search_findings(
    bench: Bench, section: ExplorationSection, selected_target: SelectedTarget, reading: str
) -> FindingSearch:
    """Search the planes of a section for hazardous faults, on its open bench."""
    build = experiment_builder(selected_target, reading, section.observe_s)
    drives = find_drives(bench, selected_target.manifest, section, build)
    search = FindingSearch(section=section, drives=drives, seed=section.planes[0].seed)
    run_exploration(bench, search, build, within_budget(None))
    return search


def experiment_builder(selected_target: SelectedTarget, reading: str, observe_s: float) -> BuildExperiment:
    """Return what builds the experiments of planes. Runs that can stop do so `observe_s` after the fault."""
    builder, after_hazard = ExperimentBuilder(selected_target), after_hazard_of(selected_target)

    build_fault = fault_builder(selected_target, reading)

    def build(
        plane: ExploredPlane, magnitude: float | None, start_s: float, duration_s: float, form: str = ""
    ) -> Experiment:
        experiment = builder.build(
            build_fault(name_with_form(plane.spec, form), magnitude, plane.seed, duration_s),
            plane.scenario,
            start_s,
            hold_s=duration_s,
            seed=plane.seed,
            after_hazard=after_hazard,
        )
        if after_hazard is AfterHazard.GO_ON:
            return experiment
        return replace(experiment, end_s=end_of_observation(start_s, duration_s, observe_s))

    return build


def after_hazard_of(selected_target: SelectedTarget) -> AfterHazard:
    """Return whether runs go on after a terminal hazard: what follows decides nothing, and costs time."""
    return AfterHazard.STOP if can_stop_at_hazard(selected_target.manifest) else AfterHazard.GO_ON


def within_budget(budget_s: float | None) -> Callable[[], bool]:
    """Return what says whether less than `budget_s` has passed since now."""
    end = math.inf if budget_s is None else time.monotonic() + budget_s
    return lambda: time.monotonic() < end
