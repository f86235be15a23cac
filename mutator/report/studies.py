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
from mutator.outcomes.paths import ways_of
from mutator.outcomes.reader import Results
from mutator.outcomes.rows import Row
from mutator.report.engines import EngineSummary, engine_summary
from mutator.report.panel import FOLDER, Panel
from mutator.report.paths import FoundPaths
from mutator.report.seen import COURSE, PLACE, Seen
from mutator.report.source_lines import SourceLines
from mutator.statistics.frame import prepare
from mutator.statistics.published import Published
from mutator.store.planned import Planned
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedRun:
    """What a report is made from.

    `texts` are all experiments of results.csv, `frame` the usable ones. Plan and records are read when they
    are asked for, by experiment id; what a report needs of all of them is in `seen`.
    Without a workspace nothing can be driven again, and no study can be asked. `study` is None if the
    campaign asks for none or if it is not installed here. `compared`: the study has something to say of these
    results, on a page of its own.
    """

    folder: RunFolder
    workspace: Workspace | None
    texts: "DataFrame"
    frame: "DataFrame"
    study: "Study | None"
    seen: Seen
    engines: EngineSummary | None = None
    compared: bool = False
    paths: FoundPaths | None = None
    source: SourceLines | None = None
    experiments: Mapping[str, Experiment] = field(default_factory=dict)  # all that are planned
    records: Mapping[str, Record] = field(default_factory=dict)

    @classmethod
    def open(cls, folder: RunFolder, workspace: Workspace | None) -> "ReportedRun":
        """A run folder whose results.csv is up to date."""
        experiments, records = Planned(folder.path), folder.records()
        texts, ways = Results.of_run(folder.path).texts(), ways_of(folder.head)
        seen = Seen.of(folder, texts, records, ways)
        return cls(
            folder=folder,
            workspace=workspace,
            texts=texts,
            frame=prepare(texts.assign(**{PLACE: seen.places, COURSE: seen.courses_of})),
            engines=engine_summary(folder, records, seen.timings),
            study=_study(folder) if workspace else None,
            seen=seen,
            paths=FoundPaths.of(folder, ways, experiments, records, seen.courses) if ways else None,
            source=SourceLines.of(folder, workspace, texts),
            experiments=experiments,
            records=records,
        )

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of results.csv, all at once; of a large run rather ask `frame`."""
        return Results.of_run(self.folder.path).rows()

    @property
    def out(self) -> Path:
        """The folder of the report."""
        return self.folder.path / FOLDER

    @property
    def done(self) -> int:
        """Experiments of the plan that ran."""
        return int((self.texts["status"] != Status.HARNESS_ERROR.value).sum())

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
