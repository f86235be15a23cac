"""Experiments as a pull request shows them: with their place in the controller, and what happened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from mutator.campaigns.fault_positions import FaultPositions, SourcePosition
from mutator.comparison.gate_failures import FailingExperiment
from mutator.comparison.run_comparison_and_gates import Comparison
from mutator.errors import MutatorError
from mutator.exports.deciding_channels import channel_history
from mutator.exports.mermaid_charts import chart_markdown
from mutator.model import Experiment, Record
from mutator.results.result_rows import ResultRow
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Highlight:
    """An experiment of a run. `title` says why it is shown, `description` how it ended, and `sentence` what
    happened. `position` is the place of its fault; None if it is not known. `hazard` is the one to draw.
    """

    experiment: Experiment
    title: str
    description: str
    sentence: str
    position: SourcePosition | None
    hazard: str | None = None


@dataclass(frozen=True)
class HighlightedSource:
    """The target of a run, if it is there and unchanged; else `reason` says why places are not shown."""

    positions: FaultPositions | None
    reason: str = ""

    @classmethod
    def of_run(cls, folder: RunFolder, workspace: Workspace | None) -> "HighlightedSource":
        if workspace is None:
            return cls(None, "the fault library was not found")
        try:
            return cls(FaultPositions.of_run(folder, workspace))
        except MutatorError as err:
            return cls(None, str(err))

    @property
    def manifest(self) -> TargetManifest | None:
        return self.positions.manifest if self.positions else None

    def position_of(self, experiment: Experiment) -> SourcePosition | None:
        if self.positions is None:
            return None
        first = self.positions.of_fault(experiment.fault)[0]
        return first if first.is_in_repository else None


def highlights_of_failures(
    source: HighlightedSource, failing: Sequence[FailingExperiment]
) -> list[Highlight]:
    """Return the experiments on which gates fail, in the same order."""
    return [
        Highlight(
            experiment=each.experiment,
            title=each.gates_text,
            description=each.description,
            sentence=each.sentence,
            position=source.position_of(each.experiment),
            hazard=_new_hazard(each),
        )
        for each in failing
    ]


def _new_hazard(failing: FailingExperiment) -> str | None:
    """Return the first hazard that the first run does not have, or the first of all."""
    if failing.pair is None:
        return None
    earlier = {name for name, _ in failing.pair.row_a.hazards}
    names = [name for name, _ in failing.pair.row_b.hazards]
    return next((name for name in (*(n for n in names if n not in earlier), *names)), None)


def highlights_of_hazards(
    source: HighlightedSource, experiments_and_rows: Sequence[tuple[Experiment, ResultRow]]
) -> list[Highlight]:
    """Return the hazardous experiments of a run, in the same order."""
    return [
        Highlight(
            experiment=experiment,
            title=row.severity_label or "hazard",
            description=f"{experiment.label}: {', '.join(name for name, _ in row.hazards)}",
            sentence=row.summary,
            position=source.position_of(experiment),
            hazard=row.hazards[0][0],
        )
        for experiment, row in experiments_and_rows
    ]


@dataclass(frozen=True, kw_only=True)
class ChartMaker:
    """Draws the channels that decide experiments of a run, and of an earlier run if there is a comparison."""

    folder: RunFolder
    source: HighlightedSource
    comparison: Comparison | None = None

    def chart(self, highlight: Highlight) -> str:
        """Return the chart in Markdown; '' if the run folder has no series of the experiment."""
        record = self._records.get(highlight.experiment.id)
        if record is None:
            return ""
        manifest, before = self.source.manifest, self._run_before(highlight.experiment)
        history = channel_history(self.folder, record, highlight.hazard, manifest, before)
        return "" if history is None else chart_markdown(history)

    @cached_property
    def _records(self) -> Mapping[str, Record]:
        return self.folder.records()

    @cached_property
    def _records_before(self) -> Mapping[str, Record]:
        return {} if self.comparison is None else self.comparison.a.folder.records()

    def _run_before(self, experiment: Experiment) -> tuple[RunFolder, Record] | None:
        if self.comparison is None:
            return None
        pair = next((pair for pair in self.comparison.pairs if pair.b.id == experiment.id), None)
        record = None if pair is None else self._records_before.get(pair.a.id)
        return None if record is None else (self.comparison.a.folder, record)
