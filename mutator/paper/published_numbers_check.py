"""Checks that the published numbers in the library are consistent."""

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mutator.config.yaml_files import load
from mutator.config.yaml_sources import Source
from mutator.errors import MutatorError
from mutator.paper.published_numbers import FILES, Paper, load_paper
from mutator.statistics.tallies import Tally, sum_tallies
from mutator.workspace import Workspace

_METHODS = ("guided", "random")
_SUMS = ("injected", "activated", "hazards")  # counts that both tables have
_REMEDY = "compare with the published table"


def check_paper(workspace: Workspace) -> Iterator[MutatorError]:
    """Yield every problem in `references/paper_*.yaml` of a library whose campaigns name the study.

    Problems are missing files, impossible numbers (`load_paper`), duplicate rows, unknown methods, scenarios
    and fault types, and sums over scenarios that differ from those over fault types.
    """
    references = workspace.references
    if missing := [name for name in FILES if not (references / name).is_file()]:
        yield MutatorError(
            f"the published numbers are not in this library: no {', '.join(missing)}",
            where=references,
            expected=f"{', '.join(FILES[:-1])} and {FILES[-1]}",
            remedy="copy them from the shipped library, or remove `study:` from the campaigns",
        )
        return
    try:
        paper = load_paper(references)
    except MutatorError as error:
        yield error
        return
    summary, coverage = (load(references / name) for name in FILES[:2])
    base = workspace.library / "faults"
    kinds = {path.relative_to(base).with_suffix("").as_posix() for path in workspace.spec_files()}
    problems = [
        *_twice(summary, lambda row: f"{row['method']} in {row['scenario']}"),
        *_unknown(summary, lambda row: row["method"], "method", set(_METHODS)),
        *_unknown(summary, lambda row: row["scenario"], "scenario", set(workspace.scenarios)),
        *_twice(coverage, _kind),
        *_unknown(coverage, _kind, "fault type", kinds),
    ]
    yield from problems or _sums(paper, coverage, summary.path)


def _kind(row: dict[str, Any]) -> str:
    return f"{row['module']}/{row['fault_type']}"


def _twice(source: Source, name_of: Callable[[dict[str, Any]], str]) -> Iterator[MutatorError]:
    seen: Counter[str] = Counter()
    for i, row in enumerate(source.data["rows"]):
        seen[name_of(row)] += 1
        if seen[name_of(row)] == 2:
            yield source.error(
                ("rows", i), f"{name_of(row)} is listed twice", expected="one row", remedy=_REMEDY
            )


def _unknown(
    source: Source, name_of: Callable[[dict[str, Any]], str], what: str, known: set[str]
) -> Iterator[MutatorError]:
    for i, row in enumerate(source.data["rows"]):
        if name_of(row) not in known:
            yield source.error(
                ("rows", i),
                f"unknown {what} '{name_of(row)}'",
                expected=f"one of {', '.join(sorted(known))}",
                remedy=f"correct the name, or add the {what} to the library",
            )


def _sums(paper: Paper, coverage: Source, summary: Path) -> Iterator[MutatorError]:
    """Yield differences between the sums of both tables, which count the same experiments."""

    def of(counts: dict[tuple[str, str], Tally], method: str) -> Tally:
        return sum_tallies(tally for (how, _), tally in counts.items() if how == method)

    for method in _METHODS:
        kinds, scenarios = of(paper.coverage, method), of(paper.summary, method)
        for name in _SUMS:
            got, expected = getattr(kinds, name), getattr(scenarios, name)
            if got != expected:
                yield coverage.error(
                    ("rows",),
                    f"{got} {method} {name} in total",
                    expected=f"{expected}, the sum in {summary.name}",
                    remedy=_REMEDY,
                )
