"""`compare`: compare two runs of the same faults, with a gate on changes for the worse."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import completion
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import Json, Only
from mutator.errors import EXIT_CHECK_FAILED, EXIT_HARNESS_ERRORS, MutatorError

if TYPE_CHECKING:
    from mutator.comparison.run_comparison import Comparison, GateFinding

NAMED = 20  # experiments listed in the terminal; the written comparison lists all of them
GATES = (
    "new-hazard, other-hazard, higher-severity, earlier-hazard, lost-alert, worse, new-crash, harness-error, "
    "unmatched, severity:CLASS (S0 to S3: RUN_B has a contact of that class or worse, RUN_A a milder one or "
    "none)"
)


def register(app: typer.Typer) -> None:
    app.command("compare", epilog=EXAMPLES)(compare)


EXAMPLES = """\b
Examples:
  mutator compare runs/before runs/after
  mutator compare runs/before runs/after --only 'module == "vision_input"'
  mutator compare runs/main runs/change --fail-on new-hazard,new-crash,harness-error
  mutator compare runs/main runs/change --fail-on severity:S2

With --fail-on, the exit code is 1 if such a change is found; each is printed. Otherwise it is 3 if
experiments lack a result in either run, because the comparison is then incomplete.
"""


def compare(
    run_a: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_A",
            help="The first run folder, e.g. before a change.",
            autocompletion=completion.runs,
        ),
    ],
    run_b: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_B",
            help="The second run folder, e.g. after the change.",
            autocompletion=completion.runs,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to write. Default: RUN_B/report/compare-<RUN_A>."),
    ] = None,
    only: Only = None,
    fail_on: Annotated[
        list[str] | None,
        typer.Option("--fail-on", metavar="KIND,...", help=f"Fail on these changes: {GATES}."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare two runs, experiment by experiment.

    Matches experiments by fault, value, scenario and trigger; target, reading and settings may differ.
    Reports which experiments became better, worse or hazardous, with paired statistics. Writes HTML, Markdown
    and CSV.
    """
    terminal = Terminal(as_json)
    gates = _gates(fail_on or [])
    with terminal.wait("comparing"):
        compared = mutator.compare(run_a, run_b, only=only)
        written = compared.write(out)
    found, failing = compared.comparison, compared.findings(gates)
    if as_json:
        terminal.emit(
            _as_json(compared, failing) | {"page": str(written.page), "pairs_csv": str(written.pairs)}
        )
    else:
        _show(terminal, compared)
        terminal.say(f"comparison: {short_path(written.markdown)} and {short_path(written.page)}")
    _judge(terminal, found, gates, failing)


def _gates(texts: list[str]) -> "list[mutator.Gate]":
    names = [name.strip() for text in texts for name in text.split(",")]
    known = [gate.value for gate in mutator.Gate]
    if strangers := [name for name in names if name not in known]:
        raise MutatorError(f"'{strangers[0]}'", where="--fail-on", expected=f"one of {', '.join(known)}")
    return [mutator.Gate(name) for name in dict.fromkeys(names)]


def _show(terminal: Terminal, compared: "mutator.RunComparison") -> None:
    found = compared.comparison
    if found.parts_remark:
        terminal.say(found.parts_remark, style="bold")
        terminal.say()
    differing = [(f.name, f.a, f.b) for f in found.facts if f.is_different]
    if differing:
        terminal.table(["what differs", found.names.a, found.names.b], differing)
        terminal.say(compared.files_text)
        terminal.say()
    for sheet in found.sheets:
        if sheet.name.endswith("_by_fault_type"):
            continue
        terminal.say(sheet.title, style="bold")
        heads, lines = list(sheet.heads), sheet.table().rows
        terminal.table(heads, lines, right=range(1, len(heads)), total=sheet.name == "changes")
        terminal.say()
    terminal.say(compared.summary)
    for remark in found.remarks:
        if remark != found.parts_remark:
            terminal.say(remark)


def _as_json(compared: "mutator.RunComparison", failing: "tuple[GateFinding, ...]") -> dict[str, object]:
    found = compared.comparison
    return {
        "run_a": str(found.a.folder.path),
        "run_b": str(found.b.folder.path),
        "pairs": len(found.pairs),
        "changed": len(found.changed_pairs),
        "changes": compared.changes,
        "not_compared": compared.not_compared,
        "differs": [fact for fact in found.facts if fact.is_different],
        "files": found.files,
        "remarks": list(found.remarks),
        "tables": {s.name: [dict(zip(s.heads, line, strict=True)) for line in s.lines] for s in found.sheets},
        "failing": failing,
    }


def _judge(
    terminal: Terminal, found: "Comparison", gates: "list[mutator.Gate]", failing: "tuple[GateFinding, ...]"
) -> None:
    for finding in failing[:NAMED]:
        terminal.complain(f"{finding.gate.value}: {finding.description} [{finding.experiment_id}]")
    if more := failing[NAMED:]:
        terminal.complain(f"and {len(more)} more")
    if failing:
        raise typer.Exit(EXIT_CHECK_FAILED)
    if gates and found.missing_result_count:
        terminal.complain(f"{counted(found.missing_result_count, 'result')} missing: finish both runs first")
        raise typer.Exit(EXIT_HARNESS_ERRORS)
