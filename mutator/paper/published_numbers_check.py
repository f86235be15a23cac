"""Checks that the published numbers in the library are consistent."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mutator.config.yaml_files import load_yaml
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.paper.published_numbers import PUBLISHED_FILE_NAMES, PublishedNumbers, load_published_numbers
from mutator.statistics.tallies import Tally, sum_tallies
from mutator.workspace import Workspace

_METHODS = ("guided", "random")
_SUMMED_COUNTS = ("injected", "activated", "hazards")  # counts that both tables have
_REMEDY = "compare with the published table"


def check_published_numbers(workspace: Workspace) -> Iterator[MutatorError]:
    """Yield every problem in `references/paper_*.yaml` of a library whose campaigns name the study.

    Problems are missing files, impossible numbers (`load_published_numbers`), duplicate rows, unknown
    methods, scenarios and fault types, and sums over scenarios that differ from those over fault types.
    """
    references = workspace.references
    if missing := [name for name in PUBLISHED_FILE_NAMES if not (references / name).is_file()]:
        yield MutatorError(
            f"the published numbers are not in this library: no {', '.join(missing)}",
            where=references,
            expected=f"{', '.join(PUBLISHED_FILE_NAMES[:-1])} and {PUBLISHED_FILE_NAMES[-1]}",
            remedy="copy them from the shipped library, or remove `study:` from the campaigns",
        )
        return
    try:
        numbers = load_published_numbers(references)
    except MutatorError as error:
        yield error
        return
    summary, coverage = (load_yaml(references / name) for name in PUBLISHED_FILE_NAMES[:2])
    faults_folder = workspace.library / "faults"
    fault_types = {
        path.relative_to(faults_folder).with_suffix("").as_posix() for path in workspace.spec_files()
    }
    problems = [
        *_duplicate_rows(summary, lambda row: f"{row['method']} in {row['scenario']}"),
        *_unknown_names(summary, lambda row: row["method"], "method", set(_METHODS)),
        *_unknown_names(summary, lambda row: row["scenario"], "scenario", set(workspace.scenarios)),
        *_duplicate_rows(coverage, _fault_type_of),
        *_unknown_names(coverage, _fault_type_of, "fault type", fault_types),
    ]
    # sums over wrong rows would only repeat the problems
    yield from problems or _unequal_sums(numbers, coverage, summary.path)


def _fault_type_of(row: dict[str, Any]) -> str:
    return f"{row['module']}/{row['fault_type']}"


def _duplicate_rows(source: YamlSource, name_of: Callable[[dict[str, Any]], str]) -> Iterator[MutatorError]:
    count_by_name: Counter[str] = Counter()
    for i, row in enumerate(source.data["rows"]):
        count_by_name[name_of(row)] += 1
        if count_by_name[name_of(row)] == 2:
            yield source.error(
                ("rows", i), f"{name_of(row)} is listed twice", expected="one row", remedy=_REMEDY
            )


def _unknown_names(
    source: YamlSource, name_of: Callable[[dict[str, Any]], str], name_kind: str, valid_names: set[str]
) -> Iterator[MutatorError]:
    for i, row in enumerate(source.data["rows"]):
        if name_of(row) not in valid_names:
            yield source.error(
                ("rows", i),
                f"unknown {name_kind} '{name_of(row)}'",
                expected=f"one of {', '.join(sorted(valid_names))}",
                remedy=f"correct the name, or add the {name_kind} to the library",
            )


def _unequal_sums(
    numbers: PublishedNumbers, coverage_source: YamlSource, summary_path: Path
) -> Iterator[MutatorError]:
    """Yield differences between the sums of both tables, which count the same experiments."""

    def total_of(tallies: dict[tuple[str, str], Tally], method: str) -> Tally:
        return sum_tallies(tally for (tally_method, _), tally in tallies.items() if tally_method == method)

    for method in _METHODS:
        by_fault_type, by_scenario = (
            total_of(numbers.tally_by_fault_type, method),
            total_of(numbers.tally_by_scenario, method),
        )
        for name in _SUMMED_COUNTS:
            got, expected = getattr(by_fault_type, name), getattr(by_scenario, name)
            if got != expected:
                yield coverage_source.error(
                    ("rows",),
                    f"{got} {method} {name} in total",
                    expected=f"{expected}, the sum in {summary_path.name}",
                    remedy=_REMEDY,
                )
