"""What a study adds to the report of a campaign that asks for it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

from mutator.campaigns.studies import find_study
from mutator.errors import MutatorError
from mutator.figures.figures import Drawing
from mutator.model import Experiment, Record, Status
from mutator.outcomes.fault_free import FaultFreeRun, fault_free_runs
from mutator.outcomes.golden import load_trace
from mutator.outcomes.reader import Results
from mutator.outcomes.rows import Row
from mutator.report.engines import EngineSummary, engine_summary
from mutator.report.panel import FOLDER, Panel
from mutator.report.paths import FoundPaths
from mutator.statistics.frame import load
from mutator.statistics.published import Published
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedRun:
    """What a report is made from.

    Plan and records are read once. `rows` are all experiments of results.csv, `frame` the usable ones.
    Without a workspace nothing can be driven again, and no study can be asked. `study` is None if the
    campaign asks for none or if it is not installed here. `compared`: the study has something to say of these
    results, on a page of its own.
    """

    folder: RunFolder
    workspace: Workspace | None
    rows: tuple[Row, ...]
    frame: "DataFrame"
    engines: EngineSummary | None
    study: "Study | None"
    compared: bool = False
    paths: FoundPaths | None = None
    experiments: Mapping[str, Experiment] = field(default_factory=dict)  # all that are planned, by id
    records: Mapping[str, Record] = field(default_factory=dict)  # by experiment id

    @classmethod
    def open(cls, folder: RunFolder, workspace: Workspace | None) -> "ReportedRun":
        """A run folder whose results.csv is up to date."""
        experiments = {experiment.id: experiment for experiment in plan_file.read_all(folder.path)}
        records = folder.records()
        return cls(
            folder=folder,
            workspace=workspace,
            rows=Results.of_run(folder.path).rows(),
            frame=load(folder.path / "results.csv"),
            engines=engine_summary(folder, records),
            study=_study(folder) if workspace else None,
            paths=FoundPaths.of(folder, experiments, records),
            experiments=experiments,
            records=records,
        )

    @property
    def out(self) -> Path:
        """The folder of the report."""
        return self.folder.path / FOLDER

    @property
    def done(self) -> int:
        """Experiments of the plan that ran."""
        return sum(row.status is not Status.HARNESS_ERROR for row in self.rows)

    def fault_free(self) -> tuple[FaultFreeRun, ...]:
        """What the golden runs do by themselves; nothing where they cannot be read."""
        if self.workspace is None:
            return ()
        try:
            return fault_free_runs(self.folder, self.workspace.manifest(self.folder.head["target"]))
        except (MutatorError, KeyError):
            return ()

    def ends(self) -> dict[str, float] | None:
        """When the golden runs of each scenario end, s of simulation; None if they cannot be read."""
        if self.workspace is None:
            return None
        ends: dict[str, float] = {}
        try:
            manifest = self.workspace.manifest(self.folder.head["target"])
            for one in self.folder.goldens:
                trace = load_trace(manifest, self.folder.golden(*one), [])
                end = float(trace[manifest.time_channel][-1])
                ends[one.scenario] = max(end, ends.get(one.scenario, end))
        except (MutatorError, KeyError):
            return None
        return ends


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Published work, as its entry point in `mutator.studies` provides it; `about` cites it.

    `check` finds problems of its data in a fault library. `published` gives the counts that stand beside a
    run's in the tables, None where they do not fit the run. Each of `panels` may give a part of the study's
    page and write files beside it; without any there is no such page. `drawings` are figures of that page.
    """

    about: str
    check: Callable[[Workspace], Iterable[MutatorError]]
    published: Callable[[ReportedRun], Published | None]
    panels: tuple[Callable[[ReportedRun], Panel | None], ...]
    drawings: Callable[[ReportedRun], tuple[Drawing, ...]]


def _study(folder: RunFolder) -> Study | None:
    """The study that a run's campaign asks for. A report can be written without it."""
    name = folder.head.get("study")  # no key in older runs
    try:
        return cast(Study, find_study(name)) if name else None
    except MutatorError:
        return None
