"""The source of a run's target, with the outcomes of the faults in each line. If the target has changed
since the run, no source is shown.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mutator.campaigns.fault_positions import numbered_lines
from mutator.errors import MutatorError
from mutator.model import OPERATOR_FAULTS_MODULE, Fault, Outcome, Status
from mutator.mutants.injection_edits import is_in_tree
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.results.outcome_counting import outcome_or_status_of_rows
from mutator.statistics.mutation_score import PERMANENT, TRANSIENT
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import ALWAYS_NAME
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from pandas import DataFrame

# Worst first, without harness errors and invalid mutants.
ENDINGS_WORST_FIRST = (
    Outcome.HAZARD.value,
    Status.CRASHED.value,
    Status.TIMEOUT.value,
    Outcome.SDC.value,
    Outcome.MASKED.value,
    Outcome.NOT_ACTIVATED.value,
)
PERMANENCE_VALUES = (PERMANENT, TRANSIENT)
_CONTEXT_LINES = 2  # lines shown before and after a marked line outside functions
_MOST_GAP_LINES = 3  # smaller gaps are shown: the note on what is left out takes a line, too


@dataclass(frozen=True, slots=True, kw_only=True)
class LineMark:
    """The worst ending of a line's mutants, the number of mutants with it, and the number of all."""

    worst_ending: str
    worst_mutant_count: int
    mutant_count: int


MarksByLine = Mapping[int, Mapping[str, LineMark]]  # line (from 1) -> permanent or transient -> mark


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkedFile:
    """A file with faults. `shown_lines` has ranges, numbered from 1."""

    path: str
    data: bytes
    lines: Sequence[str]
    shown_lines: tuple[range, ...]
    marks: MarksByLine

    def line_counts_by_ending(self) -> dict[str, int]:
        """Return the number of lines by the worst outcome or status of their mutants, worst first."""
        worst = [
            min((m.worst_ending for m in here.values()), key=ENDINGS_WORST_FIRST.index)
            for here in self.marks.values()
        ]
        return {ending: worst.count(ending) for ending in ENDINGS_WORST_FIRST if ending in worst}


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceLines:
    """The files of a run, worst first. `path_and_line_by_fault` has texts such as `pkg/plan.py:42`;
    `change_by_fault` maps each fault of an operator to its change, such as `a + b -> a - b`.
    `reason_without_files` is empty if there are files.
    """

    files: tuple[MarkedFile, ...] = ()
    path_and_line_by_fault: Mapping[str, str] = field(default_factory=dict)
    change_by_fault: Mapping[str, str]
    reason_without_files: str = ""

    @classmethod
    def of(
        cls,
        folder: RunFolder,
        workspace: Workspace | None,
        results: "DataFrame",
        faults: Mapping[str, Fault],
    ) -> "SourceLines | None":
        """Return the source of a run; None if it has no operators. `faults` are those of the plan."""
        if not (results["module"] == OPERATOR_FAULTS_MODULE).any():
            return None
        faults_with_results = {name: faults[name] for name in results["fault_id"].unique() if name in faults}
        changes = {
            name: str(fault.value)
            for name, fault in faults_with_results.items()
            if fault.module == OPERATOR_FAULTS_MODULE
        }
        try:
            manifest = workspace.manifest_of(folder.head) if workspace else None
        except (MutatorError, KeyError):
            manifest = None
        if manifest is None:
            reason = "The target was not found, so its source is not shown."
            return cls(change_by_fault=changes, reason_without_files=reason)
        if manifest.tree.digest != folder.head.sources["target"]:
            reason = (
                "The target has changed since this run was planned, so line numbers do not match and its "
                "source is not shown. Restore the target and rebuild the report (`mutator report`)."
            )
            return cls(change_by_fault=changes, reason_without_files=reason)
        return cls._with_marks(manifest, faults_with_results, results, changes)

    @classmethod
    def _with_marks(
        cls,
        manifest: TargetManifest,
        faults: Mapping[str, Fault],
        results: "DataFrame",
        changes: Mapping[str, str],
    ) -> "SourceLines":
        lines = {name: _line_of(manifest, fault) for name, fault in faults.items()}
        line_by_fault = {name: line for name, line in lines.items() if line}
        marks: dict[str, dict[int, dict[str, LineMark]]] = {path: {} for path, _ in line_by_fault.values()}
        for (path, line), lasting, mark in _line_marks(line_by_fault, results):
            marks[path].setdefault(line, {})[lasting] = mark
        files = (
            _marked_file(parsed_file(manifest.tree, path), file_marks)
            for path, file_marks in marks.items()
            if file_marks
        )
        return cls(
            files=tuple(sorted(files, key=_worst_first_key)),
            path_and_line_by_fault={name: f"{path}:{line}" for name, (path, line) in line_by_fault.items()},
            change_by_fault=changes,
        )


def _line_of(manifest: TargetManifest, fault: Fault) -> tuple[str, int] | None:
    """Return file and line of the first injection; None if it is in a defence that the tree does not have."""
    first = next((each for each in fault.injections if is_in_tree(each, manifest.tree)), None)
    if first is None:
        return None
    file = parsed_file(manifest.tree, first.location.path)
    return file.path, numbered_lines(file, first)[0]


def _line_marks(
    line_by_fault: Mapping[str, tuple[str, int]], results: "DataFrame"
) -> Iterator[tuple[tuple[str, int], str, LineMark]]:
    """Yield the marks of each line, for permanent and transient faults. Each fault is counted once, with its
    worst experiment.
    """
    ranks_by_line: dict[tuple[tuple[str, int], str], dict[str, int]] = {}
    for name, trigger, ending in zip(
        results["fault_id"], results["trigger"], outcome_or_status_of_rows(results), strict=True
    ):
        if name in line_by_fault and ending in ENDINGS_WORST_FIRST:
            ranks = ranks_by_line.setdefault(
                (line_by_fault[name], PERMANENT if trigger == ALWAYS_NAME else TRANSIENT), {}
            )
            ranks[name] = min(ENDINGS_WORST_FIRST.index(ending), ranks.get(name, len(ENDINGS_WORST_FIRST)))
    for (place, lasting), ranks in sorted(ranks_by_line.items()):
        worst = min(ranks.values())
        worst_count = sum(rank == worst for rank in ranks.values())
        yield (
            place,
            lasting,
            LineMark(
                worst_ending=ENDINGS_WORST_FIRST[worst],
                worst_mutant_count=worst_count,
                mutant_count=len(ranks),
            ),
        )


def _marked_file(file: ParsedFile, marks: MarksByLine) -> MarkedFile:
    return MarkedFile(
        path=file.path,
        data=file.data,
        lines=[line.rstrip(b"\r\n").decode(file.encoding) for line in file.lines],
        shown_lines=_merge_ranges(_lines_around(file, line) for line in marks),
        marks=marks,
    )


def _lines_around(file: ParsedFile, line: int) -> range:
    """Return the outermost function around `line`; outside functions, a few lines."""
    function = file.outermost_function_at(line - 1)
    if function is not None:
        return range(function.start + 1, function.stop + 1)
    return range(max(1, line - _CONTEXT_LINES), min(len(file.lines), line + _CONTEXT_LINES) + 1)


def _merge_ranges(parts: Iterable[range]) -> tuple[range, ...]:
    """Return the ranges in order, joined if they almost touch."""
    merged: list[range] = []
    for part in sorted(parts, key=lambda part: (part.start, part.stop)):
        if merged and part.start <= merged[-1].stop + _MOST_GAP_LINES:
            merged[-1] = range(merged[-1].start, max(merged[-1].stop, part.stop))
        else:
            merged.append(part)
    return tuple(merged)


def _worst_first_key(file: MarkedFile) -> tuple[object, ...]:
    counts = file.line_counts_by_ending()
    return (*(-counts.get(ending, 0) for ending in ENDINGS_WORST_FIRST), file.path)
