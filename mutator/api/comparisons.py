"""Comparison of two runs of the same faults, as pandas frames, and the history of many."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.confined_files import path_below
from mutator._common.table_rendering import TextTable
from mutator.api.notebook_html import text_html
from mutator.api.run_envelopes import RunEnvelope
from mutator.api.runs import Run, alerts_note_if_any, load_run, scene_if_any
from mutator.comparison import comparison_files
from mutator.comparison import run_comparison_and_gates as comparing
from mutator.comparison.experiment_matching import ExperimentPair, ResultChangeKind
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, GateFinding
from mutator.errors import CheckFailed, MutatorError
from mutator.report import run_history
from mutator.report.run_history import History

if TYPE_CHECKING:
    import pandas as pd

MOST_TABLES_SHOWN = 3  # tables shown in a notebook: endings, changes, rates


@dataclass(frozen=True, eq=False, repr=False)
class RunComparison:
    """Two runs, matched experiment by experiment."""

    comparison: Comparison  #: the comparison, with all details of the pairs

    def __repr__(self) -> str:
        names = self.comparison.names
        return f"<RunComparison {names.a} against {names.b}: {self.summary}>"

    def _repr_html_(self) -> str:
        names = self.comparison.names
        differing = [[f.name, f.a, f.b] for f in self.comparison.facts if f.is_different]
        facts = str(TextTable(heads=("what differs", names.a, names.b), rows=differing).as_html())
        # as `str`, because Markup would escape the text before it once more
        sheets = [
            text_html(s.title) + str(s.table().as_html()) for s in self.comparison.sheets[:MOST_TABLES_SHOWN]
        ]
        remarks = "".join(map(text_html, self.comparison.remarks))
        return text_html(self.summary) + remarks + facts + "".join(sheets)

    @property
    def summary(self) -> str:
        """The comparison in a few sentences."""
        return comparison_files.summary_text(self.comparison)

    @property
    def files_text(self) -> str:
        """A text that says which of the target's files differ."""
        return comparison_files.differing_files_text(self.comparison)

    @property
    def not_compared(self) -> dict[str, int]:
        """Reasons why experiments could not be compared, with counts."""
        return dict(comparison_files.unmatched_count_by_reason(self.comparison))

    @property
    def changes(self) -> dict[str, int]:
        """Number of pairs with each kind of change."""
        return {change.value: len(self.comparison.pairs_with_change(change)) for change in ResultChangeKind}

    @cached_property
    def pairs(self) -> "pd.DataFrame":
        """One row for each experiment that both runs have, with the columns of pairs.csv. Columns of a single
        run end in `_a` or `_b`. Times are in s since the start of the simulation.
        """
        return _pair_cells_frame(self.comparison.pairs)

    @cached_property
    def changed(self) -> "pd.DataFrame":
        """The rows of `pairs` whose result changed, new hazards first."""
        return _pair_cells_frame(self.comparison.changed_pairs)

    @cached_property
    def tables(self) -> "dict[str, pd.DataFrame]":
        """The tables by name: endings, changes, and rates and times with paired statistics.

        A share has five columns: count, of, rate and both ends of its interval.
        """
        return {sheet.name: sheet.as_frame() for sheet in self.comparison.sheets}

    def findings(self, gates: Sequence[Gate | str]) -> tuple[GateFinding, ...]:
        """Return the experiments that fail a gate, in the order of `gates`.

        A gate is a Gate or its name, such as `new-hazard` or `severity:S2`.
        MutatorError for an unknown gate, and for a severity gate if a run has no severity classes.
        """
        gate_names = [gate.value for gate in Gate]
        if unknown := [gate for gate in gates if gate not in gate_names]:
            raise MutatorError(
                f"gate '{unknown[0]}'", argument="gates", expected=f"one of {', '.join(gate_names)}"
            )
        return comparing.findings_of_gates(self.comparison, [Gate(gate) for gate in gates])

    def write(self, out: str | Path | None = None) -> comparison_files.ComparisonFiles:
        """Write HTML, Markdown and CSV to `out`; default: report/compare-<first run> in the second run."""
        a, b = self.comparison.a, self.comparison.b
        default = path_below(b.folder.path / "report", f"compare-{a.name}")
        return comparison_files.write_comparison(self.comparison, default if out is None else Path(out))


def compare(a: Run | str | Path, b: Run | str | Path, *, only: str | None = None) -> RunComparison:
    """Compare two runs, experiment by experiment: `a` is before, `b` after.

    Experiments are matched by fault, value, scenario and trigger; target, reading and settings may differ.
    `only` is a filter over the experiments' planned properties. MutatorError if no experiments match;
    CheckFailed if the equivalence check of a run failed.
    """
    runs = [run if isinstance(run, Run) else load_run(run) for run in (a, b)]
    first, second = map(alerts_note_if_any, runs)
    scenes = (scene_if_any(runs[0]), scene_if_any(runs[1]))
    envelopes = (_envelopes_if_any(runs[0]), _envelopes_if_any(runs[1]))
    return RunComparison(
        comparing.compare_runs(runs[0].path, runs[1].path, only, (first, second), scenes, envelopes)
    )


def _envelopes_if_any(run: Run) -> tuple[RunEnvelope, ...]:
    """Return the envelopes of an exploration; empty without a library that has its target."""
    try:
        return run.envelopes
    except CheckFailed:
        raise
    except (MutatorError, KeyError):
        return ()


def _pair_cells_frame(pairs: Sequence[ExperimentPair]) -> "pd.DataFrame":
    import pandas as pd

    frame = pd.DataFrame([comparison_files.pair_cells(pair) for pair in pairs])
    times = [name for name in frame.columns if name.startswith("t_")]
    # otherwise, a column of missing times would have the type object
    return frame.astype(dict.fromkeys(times, float))


def write_history(folder: str | Path) -> History:
    """Write HISTORY.md and history.html into a folder of run folders: the results of each run, and what
    changed between runs of the same plan. MutatorError if the folder holds no run with results.
    """
    return run_history.write_history(Path(folder))
