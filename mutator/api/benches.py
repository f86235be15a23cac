"""Benches: ask list after list of experiments, at the price of the engine."""

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mutator._common.argument_checks import check_whole_number
from mutator.api.experiments import ExperimentBuilder, checked_after_hazard
from mutator.api.runs import Run
from mutator.api.scenario_choice import ScenarioLike
from mutator.api.target_and_fault_selection import (
    FaultLike,
    SelectedTarget,
    TriggerLike,
    WorkspaceLike,
    open_workspace,
)
from mutator.campaigns.campaign_files import load_campaign
from mutator.engines.engine_choice import check_engine_is_offered
from mutator.errors import EXIT_CHECK_FAILED, IncompleteRun, MutatorWarning
from mutator.execution import bench as bench_in_folder
from mutator.execution.bench_opening import finishing, opened_bench
from mutator.execution.distributor_choice import Distributor, choose_distributor
from mutator.execution.session_summary import Summary
from mutator.model import AfterHazard, Experiment, Fault, Record
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@contextmanager
def open_bench(
    workspace: WorkspaceLike,
    out: str | Path,
    *,
    target: str | None = None,
    campaign: str | Path | None = None,
    canary: Mapping[str, Any] | None = None,
    limits: Mapping[str, int] | None = None,
    reading: str | None = None,
    seed: int = 0,
    after_hazard: AfterHazard | str = AfterHazard.GO_ON,
    include: str | None = None,
    workers: int = 1,
    engine: str | None = None,
    reuse: bool = True,
    cluster: str | None = None,
    insecure_network: bool = False,
) -> "Iterator[Bench]":
    """Open a bench in the run folder `out`, for a `with` block: it answers list after list of experiments.

    Workers, fork servers and golden runs stay between lists. The folder is an ordinary run folder, which all
    commands read. It can be opened again, also after an interruption: nothing that has finished is repeated.
    At the end of the block, a sample is proved, and tables and seal are made, as at the end of a campaign.

    * `canary`, `limits`, `include`: as the keys of a campaign file; default: those of `campaign`, if one is
      named. Without a canary, results begin with a note.
    * `reading`, `after_hazard`: what all experiments have. `seed` decides what the proof draws.
    * `workers`: number of processes. `engine` and `reuse`: as for `run`.
    * `cluster`, `insecure_network`: as for `run`. What was asked for is dealt to the cluster once a record is
      waited for; the workers stay until the end of the block. `workers` are for the checks.

    MutatorError for an invalid argument, and if `out` holds another run or is in use. After the block, an
    IncompleteRun warning is issued if experiments have no result.
    """
    check_whole_number("seed", seed)
    check_whole_number("workers", workers, least=1)
    check_engine_is_offered(engine)
    opened_workspace = open_workspace(workspace)
    selected_target, values = bench_values(
        opened_workspace, target=target, campaign=campaign, reading=reading, seed=seed
    )
    arguments = {"canary": canary, "limits": limits, "include": include}
    values |= {name: value for name, value in arguments.items() if value is not None}
    values |= {"after_hazard": checked_after_hazard(after_hazard).value}
    with (
        opened_bench(
            opened_workspace,
            Path(out),
            values,
            workers=workers,
            engine=engine,
            reuse=reuse,
            distributor=distributor_of_cluster(cluster, insecure_network=insecure_network),
        ) as opened,
        finishing(opened),
    ):
        yield Bench(opened, selected_target, values["reading"])
    warn_of_end(opened.summary)


class Bench:
    """An open bench. One caller uses it at a time."""

    def __init__(self, opened: bench_in_folder.Bench, selected_target: SelectedTarget, reading: str) -> None:
        self._opened, self._reading = opened, reading
        self._selected_target, self._builder = selected_target, ExperimentBuilder(selected_target)

    def __repr__(self) -> str:
        return f"<Bench {self.path.name}: {self._opened.experiment_count} experiments>"

    @property
    def path(self) -> Path:
        """The run folder."""
        return self._opened.path

    @property
    def pending(self) -> tuple[Experiment, ...]:
        """Planned experiments without a result: they were cut off, or the harness failed."""
        return self._opened.pending

    def build_experiment(
        self,
        fault: FaultLike,
        scenario: ScenarioLike,
        trigger: TriggerLike = "always",
        *,
        value: float | None = None,
        hold_s: float | None = None,
        seed: int = 0,
        armed_after_s: float | None = None,
        setting: Sequence[str] = (),
        beyond: bool = False,
    ) -> Experiment:
        """Build an experiment for this bench: see `mutator.build_experiment`."""
        return self._builder.build(
            fault,
            scenario,
            trigger,
            value=value,
            hold_s=hold_s,
            seed=seed,
            reading=None if isinstance(fault, Fault) else self._reading,
            armed_after_s=armed_after_s,
            setting=setting,
            after_hazard=self._opened.after_hazard,
            beyond=beyond,
        )

    def run(self, experiments: Iterable[Experiment], reason: str = "") -> list[Record]:
        """Return the record of each experiment, in order.

        An experiment that has a result is not run again. `reason` is kept with the batch. MutatorError for an
        experiment that does not fit the bench, for a source that was edited while it was open, for a second
        caller, and if a worker fails; CheckFailed if a golden run fails its checks. Nothing of the batch is
        then planned, except after the failure of a worker.
        """
        return self._opened.run(experiments, reason)

    def submit(self, experiments: Iterable[Experiment], reason: str = "") -> None:
        """Ask for a list as `run` does, and return while it runs: `results` gives its records.

        Several lists can be in flight, so that the workers need not wait for the next one. The plan has them
        in the order in which they were submitted.
        """
        self._opened.submit(experiments, reason)

    def results(self) -> Iterator[Record]:
        """Yield the records of all submitted lists as they come, until none is in flight.

        More can be submitted meanwhile. An experiment has a record for each time it was submitted. The order
        depends on the machine; tables and seal do not. MutatorError if a worker fails; like after an
        interruption, nothing is then in flight, and `pending` has what did not finish.
        """
        return self._opened.results()

    def prove(self) -> EquivalenceResult | None:
        """Run again, on the reference engine, what the final sample contains of the experiments so far, once
        no list is in flight.

        None if no experiment was forked. CheckFailed if a record differs.
        """
        return self._opened.prove()

    def load(self) -> Run:
        """Return the run folder as it is now; call it again after the next batch."""
        return Run(RunFolder.open(self.path), self._selected_target.workspace)


def distributor_of_cluster(cluster: str | None, *, insecure_network: bool) -> Distributor | None:
    """Return what deals to the cluster; None without one, as the bench's own workers then do the work."""
    distributor = choose_distributor(cluster, insecure=insecure_network)
    return distributor if cluster is not None else None


def warn_of_end(summary: Summary | None) -> None:
    if summary is None or not summary.exit_code:
        return
    if summary.exit_code == EXIT_CHECK_FAILED:
        text = "no experiment reached a hazard, and without a canary nothing shows that one can be reached"
        text = summary.golden_hazards_note if summary.has_left_out_all else text
        warnings.warn(text, MutatorWarning, stacklevel=4)
    else:
        warnings.warn(summary.describe_unfinished(), IncompleteRun, stacklevel=4)


def bench_values(
    workspace: Workspace, *, target: str | None, campaign: str | Path | None, reading: str | None, seed: int
) -> tuple[SelectedTarget, dict[str, Any]]:
    """Return the target of a new bench, and the values of its file, as far as these arguments give them."""
    values = _values_of_campaign(workspace, campaign)
    selected_target = SelectedTarget.of(workspace, target or values.pop("target", None))
    values["target"] = selected_target.manifest.name
    return selected_target, {**values, "reading": _checked_reading(workspace, reading), "seed": seed}


def _checked_reading(workspace: Workspace, reading: str | None) -> str:
    """Return the reading, by default the library's; MutatorError unless the library has it."""
    readings = workspace.readings()
    if reading is None:
        return readings.default_name
    readings.check_name(reading)
    return reading


def _values_of_campaign(workspace: Workspace, campaign: str | Path | None) -> dict[str, Any]:
    """Return name and purpose of a bench, and what it takes over from a campaign: target, canary, the
    scenarios that it includes, and the limits that its file names.
    """
    values: dict[str, Any] = {"name": "bench", "about": "Experiments that were asked for in batches."}
    if campaign is None:
        return values
    loaded = load_campaign(workspace.campaign(campaign))
    values["target"] = loaded.target
    if loaded.canary is not None:
        values["canary"] = asdict(loaded.canary)
    if loaded.include is not None:
        values["include"] = loaded.include.value
    if limits := loaded.yaml_source.data.get("limits"):
        values["limits"] = dict(limits)
    return values
