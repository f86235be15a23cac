"""`compare`: compare two runs of the same faults, with a gate on changes for the worse."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted, spelling_suggestion
from mutator.cli import shell_completion
from mutator.cli.github_step import GitHub, GitHubStep, showing_errors
from mutator.cli.merge_report_clean_commands import workspace_if_any
from mutator.cli.shared_options import Json, Only, Wide, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import EXIT_CHECK_FAILED, EXIT_HARNESS_ERRORS, MutatorError

if TYPE_CHECKING:
    from mutator.comparison.run_comparison_and_gates import Comparison, GateFinding

MOST_LISTED_FINDINGS = 20  # experiments listed in the terminal; the written comparison lists all of them
GATES_HELP = (
    "new-hazard, new-silent-hazard (no alert comes before it; new, or its alert is lost), other-hazard, "
    "golden-hazard (without any fault), higher-severity, earlier-hazard, lost-alert, worse, new-crash, "
    "harness-error, smaller-envelope (of an exploration), unmatched, severity:CLASS (S0 to S3: RUN_B has a "
    "hazard of that class or worse, RUN_A a milder one or none)"
)


def register(app: typer.Typer) -> None:
    app.command("compare", epilog=EXAMPLES)(compare)


EXAMPLES = """\b
Examples:
  mutator compare runs/before runs/after
  mutator compare runs/before runs/after --only 'module == "vision_input"'
  mutator compare runs/main runs/change \\
    --fail-on new-hazard,new-silent-hazard,other-hazard,golden-hazard,new-crash,harness-error,unmatched
  mutator compare runs/main runs/change --fail-on severity:S2
  mutator compare runs/speed_before runs/speed_after --fail-on smaller-envelope
  mutator compare runs/main runs/change --fail-on new-hazard --github

With --fail-on, the exit code is 1 if such a change is found; each is printed. Otherwise it is 3 if
experiments lack a result in either run, because the comparison is then incomplete.

With --github and without --fail-on, changes for the worse are shown as warnings.
"""


@with_workspace_options
def compare(
    run_a: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_A",
            help="The first run folder, e.g. before a change.",
            autocompletion=shell_completion.complete_runs,
        ),
    ],
    run_b: Annotated[
        Path,
        typer.Argument(
            metavar="RUN_B",
            help="The second run folder, e.g. after the change.",
            autocompletion=shell_completion.complete_runs,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Where to write. Default: RUN_B/report/compare-<RUN_A>."),
    ] = None,
    only: Only = None,
    fail_on: Annotated[
        list[str] | None,
        typer.Option(
            "--fail-on",
            metavar="KIND,...",
            help=f"Fail on these changes: {GATES_HELP}.",
            autocompletion=shell_completion.complete_gates,
        ),
    ] = None,
    github: GitHub = False,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Compare two runs, experiment by experiment.

    Matches experiments by fault, value, scenario and trigger; target, reading and settings may differ.
    Reports which experiments became better, worse or hazardous, with paired statistics. Writes HTML, Markdown
    and CSV.
    """
    terminal = Terminal(as_json, wide)
    gates = _parse_gates(fail_on or [])
    step = GitHubStep.of_environment() if github else None
    workspace = workspace_if_any(workspace_options)
    with showing_errors(step), terminal.show_spinner("comparing"):
        runs = [mutator.load_run(run, workspace=workspace) for run in (run_a, run_b)]
        run_comparison = mutator.compare(*runs, only=only)
        files = run_comparison.write(out)
        comparison, failing = run_comparison.comparison, run_comparison.findings(gates)
    if as_json:
        terminal.print_json(
            _comparison_as_json(run_comparison, failing)
            | {"page": str(files.page), "pairs_csv": str(files.pairs)}
        )
    else:
        _print_comparison(terminal, run_comparison)
        terminal.print_text(f"comparison: {short_path(files.markdown)} and {short_path(files.page)}")
    if step:
        from mutator.api.github_output import comparison_on_github

        step.show(comparison_on_github(run_comparison, gates, workspace, os.environ), to_stderr=as_json)
    _fail_on_findings(terminal, comparison, gates, failing)


def _parse_gates(texts: list[str]) -> "list[mutator.Gate]":
    names = [name.strip() for text in texts for name in text.split(",")]
    gate_names = [gate.value for gate in mutator.Gate]
    if unknown := [name for name in names if name not in gate_names]:
        raise MutatorError(
            f"no kind '{unknown[0]}'",
            where="--fail-on",
            expected=f"one of {', '.join(gate_names)}",
            remedy="correct the name" + spelling_suggestion(unknown[0], gate_names),
        )
    return [mutator.Gate(name) for name in dict.fromkeys(names)]


def _print_comparison(terminal: Terminal, run_comparison: "mutator.RunComparison") -> None:
    comparison = run_comparison.comparison
    for remark in comparison.campaign_remarks:
        terminal.print_text(remark, style="bold")
    if comparison.campaign_remarks:
        terminal.print_text()
    differing = [(f.name, f.a, f.b) for f in comparison.facts if f.is_different]
    if differing:
        terminal.print_table(["what differs", comparison.names.a, comparison.names.b], differing)
        terminal.print_text(run_comparison.files_text)
        terminal.print_text()
    for sheet in comparison.sheets:
        if sheet.name.endswith("_by_fault_type"):  # too long for a terminal
            continue
        terminal.print_text(sheet.title, style="bold")
        heads, lines = list(sheet.heads), sheet.table().rows
        terminal.print_table(
            heads, lines, right_aligned=range(1, len(heads)), last_is_total=sheet.name == "changes"
        )
        if sheet.name == "severity":  # its heads are names of classes
            terminal.print_text(sheet.note)
        terminal.print_text()
    terminal.print_text(run_comparison.summary)
    for remark in comparison.remarks:
        if remark not in comparison.campaign_remarks:
            terminal.print_text(remark)


def _comparison_as_json(
    run_comparison: "mutator.RunComparison", failing: "tuple[GateFinding, ...]"
) -> dict[str, object]:
    comparison = run_comparison.comparison
    return {
        "run_a": str(comparison.a.folder.path),
        "run_b": str(comparison.b.folder.path),
        "pairs": len(comparison.pairs),
        "changed": len(comparison.changed_pairs),
        "changes": run_comparison.changes,
        "not_compared": run_comparison.not_compared,
        "differs": [fact for fact in comparison.facts if fact.is_different],
        "files": comparison.differing_target_files,
        "remarks": list(comparison.remarks),
        "tables": {
            s.name: [dict(zip(s.heads, line, strict=True)) for line in s.lines] for s in comparison.sheets
        },
        "failing": failing,
    }


def _fail_on_findings(
    terminal: Terminal,
    comparison: "Comparison",
    gates: "list[mutator.Gate]",
    failing: "tuple[GateFinding, ...]",
) -> None:
    from mutator.comparison.gate_failures import failing_experiments

    experiments = failing_experiments(comparison, failing)  # one can fail several gates
    length = terminal.id_length(each.experiment.id for each in experiments)
    lines = [
        f"{each.gates_text}: {each.description} [{each.experiment.id[:length]}]"
        f"{each.sentence and f': {each.sentence}'}"
        for each in experiments
    ]
    for line in lines[:MOST_LISTED_FINDINGS]:
        terminal.print_error(line)
    if unlisted := lines[MOST_LISTED_FINDINGS:]:
        terminal.print_error(f"and {len(unlisted)} more")
    if failing:  # outweighs missing results
        raise typer.Exit(EXIT_CHECK_FAILED)
    if gates and comparison.missing_result_count:
        terminal.print_error(
            f"{counted(comparison.missing_result_count, 'result')} missing: finish both runs first"
        )
        raise typer.Exit(EXIT_HARNESS_ERRORS)
