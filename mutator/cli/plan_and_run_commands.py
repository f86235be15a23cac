"""`plan` and `run`: plan and run campaigns."""

import os
import shlex
import sys
import warnings
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator.cli import shell_completion
from mutator.cli.envelope_printing import print_envelopes
from mutator.cli.exploration_printing import plan_exploration, print_exploration
from mutator.cli.github_step import GitHub, GitHubStep, showing_errors
from mutator.cli.merge_report_clean_commands import print_outcome_counts
from mutator.cli.plan_printing import print_plan, print_plan_as_json
from mutator.cli.shared_options import (
    AcceptVersions,
    Cluster,
    Engine,
    Exclude,
    InsecureNetwork,
    Json,
    Limit,
    Only,
    OutRunFolder,
    Proportional,
    Reading,
    Seed,
    SeriesMb,
    Shard,
    Wide,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import MutatorError
from mutator.execution.progress_text import describe_duration

if TYPE_CHECKING:
    from mutator.api.runs import Run
    from mutator.execution.session_summary import Summary
    from mutator.report.report_builder import WrittenReport
    from mutator.store.run_progress import ProgressCallback

CampaignName = Annotated[
    str,
    typer.Argument(
        metavar="CAMPAIGN",
        help="Name of a campaign in the library, or a campaign file.",
        autocompletion=shell_completion.complete_campaigns,
    ),
]

WORKERS_DEFAULT_HELP = "Default: one per usable core."


def register(app: typer.Typer) -> None:
    app.command("plan", epilog=PLAN_EXAMPLES)(plan)
    app.command("run", epilog=RUN_EXAMPLES)(run)


PLAN_EXAMPLES = """\b
Examples:
  mutator plan quickstart --out runs/first
  mutator plan quickstart --out runs/chaff --only 'fault_type == "chaff"' -n 4
"""


@with_workspace_options
def plan(
    campaign: CampaignName,
    out: OutRunFolder,
    workers: Annotated[
        int | None,
        typer.Option(
            "-n", "--workers", min=1, help=f"Estimate for this many workers. {WORKERS_DEFAULT_HELP}"
        ),
    ] = None,
    only: Only = None,
    exclude: Exclude = None,
    limit: Limit = None,
    proportional: Proportional = False,
    seed: Seed = None,
    reading: Reading = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Freeze a campaign's experiments without running any.

    Prints the expected time and disk space. `run` with the same folder then runs exactly these experiments.
    Of a campaign that explores, prints the planes and freezes nothing: results decide what is driven.
    """
    from mutator.api.plans import explores, reasons_not_to_fork

    terminal = Terminal(as_json, wide)
    workspace = workspace_options.workspace()
    choices = mutator.Choices(
        seed=seed, reading=reading, only=only, exclude=exclude, limit=limit, proportional=proportional
    )
    command = ["mutator", "run", campaign, "--out", str(out), *(["-n", str(workers)] if workers else [])]
    if explores(workspace, campaign):
        print_exploration(terminal, plan_exploration(workspace, campaign, choices), as_json=as_json)
        terminal.print_command("run it:", shlex.join(command))
        return
    with terminal.show_spinner("planning"):
        new_plan = mutator.plan(campaign, out, choices=choices, workspace=workspace)
    folder = out.resolve()
    reason_by_variant = reasons_not_to_fork(new_plan, workspace)
    cost = new_plan.cost(workers or usable_cores())
    if as_json:
        print_plan_as_json(terminal, folder, new_plan, cost, reason_by_variant)
    print_plan(terminal, new_plan, cost, reason_by_variant)
    # enough to compare by eye; run.json has all digits
    terminal.print_text(f"plan: {short_path(folder / 'plan.csv')} (digest {new_plan.digest[:16]})")
    terminal.print_command("run it:", shlex.join(command))


RUN_EXAMPLES = """\b
Examples:
  mutator run quickstart --out runs/first
  mutator run my_campaign.yaml --out runs/mine --limit 20
  mutator run quickstart --out runs/part1 --shard 1/3 -n 4
  mutator run paper --out runs/paper --cluster tls://10.0.0.5:8786
  mutator run quickstart --out runs/s1 --only 'scenario == "S1" and method == "guided"'

The same command resumes an interrupted or killed run.
"""


@with_workspace_options
def run(
    campaign: CampaignName,
    out: OutRunFolder,
    workers: Annotated[
        int | None,
        typer.Option(
            "-n", "--workers", min=0, help=f"Worker processes; 0: only this process. {WORKERS_DEFAULT_HELP}"
        ),
    ] = None,
    only: Only = None,
    exclude: Exclude = None,
    limit: Limit = None,
    proportional: Proportional = False,
    seed: Seed = None,
    reading: Reading = None,
    shard: Shard = None,
    series_mb: SeriesMb = None,
    engine: Engine = None,
    reviewed: Annotated[
        bool,
        typer.Option(
            "--require-reviewed", help="Refuse to run unless `mutator review` approved every mutant."
        ),
    ] = False,
    accept_versions: AcceptVersions = False,
    no_reuse: Annotated[
        bool,
        typer.Option("--no-reuse", help="Run every experiment, even if an earlier run had the same one."),
    ] = False,
    since: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN",
            help="Leave out experiments if nothing that they executed in this earlier run has changed; their "
            "earlier results stand. Both runs need Python 3.12.",
        ),
    ] = None,
    last_failed: Annotated[
        bool,
        typer.Option(
            "--last-failed",
            help="Run only what failed in the run of --since or, without it, in this folder: hazards, and "
            "runs that did not end normally. If nothing failed, run everything.",
        ),
    ] = False,
    cluster: Cluster = None,
    insecure_network: InsecureNetwork = False,
    stills: Annotated[
        bool,
        typer.Option(
            help="Rerun the worst camera experiments to add stills to the report: one in 20, at most ten. "
            "Takes about two minutes."
        ),
    ] = True,
    github: GitHub = False,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Run or resume a campaign; print its results and write its report."""
    from mutator.cli.progress_display import campaign_progress

    terminal = Terminal(as_json, wide)
    step = GitHubStep.of_environment() if github else None
    workspace = workspace_options.workspace()
    choices = mutator.Choices(
        seed=seed,
        reading=reading,
        only=only,
        exclude=exclude,
        limit=limit,
        proportional=proportional,
        shard=shard,
    )
    choices = replace(choices, series_mb=series_mb)
    workers = usable_cores() if workers is None else workers
    try:
        with showing_errors(step), campaign_progress(terminal) as notify, warnings.catch_warnings():
            warnings.simplefilter("ignore", mutator.IncompleteRun)  # `_print_results` reports it
            finished_run = mutator.run(
                campaign,
                out,
                choices=choices,
                workers=workers,
                engine=engine,
                reviewed=reviewed,
                accept_versions=accept_versions,
                reuse=not no_reuse,
                since=since,
                last_failed=last_failed,
                cluster=cluster,
                insecure_network=insecure_network,
                progress=notify,
                workspace=workspace,
            )
        summary = finished_run.summary
        assert summary is not None  # `mutator.run` always sets it
        _print_results(terminal, finished_run, summary)
        _print_defended_runs(terminal, summary)
        if reviewed and summary.defended:
            terminal.print_note(_REVIEW_NOTE)
        with showing_errors(step), campaign_progress(terminal) as notify:
            # resuming an unfinished run can change the worst experiments
            if stills and summary.exit_code == 0:
                _take_stills(terminal, finished_run, notify, workers)
            report = _write_report(out, finished_run, notify)
    except KeyboardInterrupt:
        raise typer.Abort(f"interrupted; finished experiments are kept; resume: {resume_command()}") from None
    report_paths = (
        [out / path.relative_to(finished_run.path) for path in (report.markdown, report.page)]
        if report
        else []
    )
    if as_json:
        _print_results_as_json(terminal, out, summary, report_paths)
    if report_paths:
        terminal.print_text(f"report: {report_paths[0]} and {report_paths[1]}")
    if step and report:
        from mutator.api.github_output import run_on_github

        output = run_on_github(finished_run, summary, workspace, os.environ)
        step.show(output, to_stderr=as_json)
    if summary.exit_code:
        raise typer.Exit(summary.exit_code)


_REVIEW_NOTE = (
    "approvals cover the lines of faults, which are the same with defences; "
    "the defences' own lines and models are not reviewed here"
)


def _print_defended_runs(terminal: Terminal, summary: "Summary") -> None:
    """Print what came of the campaign with each of its sets of defences."""
    for name, defended in summary.defended.items():
        counts = ", ".join(f"{outcome} {count}" for outcome, count in defended.outcomes.items())
        progress = f"{defended.done} of {defended.planned} experiments done, {defended.ran} now"
        terminal.print_text(f"with {name}: {counts}; {progress}")
        for note in (defended.provisional_note, defended.reuse_note, defended.proof_note):
            if note:
                terminal.print_text(f"  {note}")
        for digest_name, value in defended.seals.digest_by_name().items():
            terminal.print_text(f"  {digest_name}: {value}")
        for experiment, detail in defended.harness_errors[:5]:
            terminal.print_text(f"  {experiment}: {detail}", style="red")
        if defended.problem:
            terminal.print_error(defended.problem)


def _take_stills(terminal: Terminal, run: "Run", notify: "ProgressCallback", workers: int) -> None:
    if problem := run.take_stills(notify, workers=workers):
        terminal.print_note(f"no stills of {problem}")


def _write_report(out: Path, run: "Run", notify: "ProgressCallback") -> "WrittenReport | None":
    if not (run.summary and run.summary.results):  # no table: the disk was full
        return None
    notify(mutator.Progress(stage="report"))
    try:
        return run.report()
    except MutatorError:  # the folder is no longer locked: `clean` may have deleted it
        if not run.finish_deletion():
            raise
        raise MutatorError(
            "another command deleted the folder while its report was written",
            where=out,
            remedy="run the campaign again",
        ) from None


def _print_results_as_json(
    terminal: Terminal, out: Path, summary: "Summary", report_paths: Sequence[Path]
) -> None:
    counts = {"planned": summary.planned, "done": summary.done, "ran": summary.ran}
    counts |= {"reused": summary.reused, "left_out": summary.left_out, "unselected": summary.unselected}
    paths = {"run": str(out), "report": str(report_paths[0]) if report_paths else None}
    errors = [{"experiment": i, "detail": d} for i, d in summary.harness_errors]
    outcomes = {"outcomes": summary.outcomes, "harness_errors": errors, "proof": summary.proof}
    sets = {
        name: {"planned": defended.planned, "done": defended.done, "ran": defended.ran}
        | {"outcomes": defended.outcomes}
        | asdict(defended.seals)
        for name, defended in summary.defended.items()
    }
    more = {"not_forked": summary.not_forked} | ({"defended": sets} if sets else {})
    terminal.print_json(counts | paths | outcomes | asdict(summary.seals) | more)


def _print_results(terminal: Terminal, run: "Run", summary: "Summary") -> None:
    """Print what does not need to wait for stills and report."""
    if summary.defended and (note := run.defence_hazards_note()):
        terminal.print_text(note)
    if summary.results and summary.planned:
        print_outcome_counts(terminal, run)
    if not summary.is_provisional and (note := run.drives_note()):
        terminal.print_text(note)
    if envelopes := run.envelopes:
        print_envelopes(terminal, envelopes)
    terminal.print_text(
        f"{summary.done} of {summary.planned} experiments done, {summary.ran} now; "
        f"checks, experiments and proof took {describe_duration(summary.elapsed_s)}"
    )
    for note in (
        summary.provisional_note,
        "" if summary.results else summary.golden_hazards_note,
        summary.reuse_note,
        summary.since_note,
        summary.selection_note,
    ):
        if note:
            terminal.print_text(note)
    if summary.proof_note:
        terminal.print_text(f"proof: {summary.proof_note}")
    for name, value in summary.seals.digest_by_name().items():
        terminal.print_text(f"{name}: {value}")
    if summary.harness_errors:
        terminal.print_text(
            f"harness errors: {len(summary.harness_errors)} (not in rates; the same command retries them)"
        )
        length = terminal.id_length(run.folder.experiment_ids())
        for name, detail in summary.harness_errors[:5]:  # often the same error; --json has all
            terminal.print_text(f"  {name[:length]}: {detail}", style="red")
    if summary.problem:
        terminal.print_error(summary.problem)
    if summary.interrupted or summary.done + summary.unselected < summary.planned:
        terminal.print_command("resume:", resume_command())
    sys.stdout.flush()  # a pipe, too, gets them before stills and report are made


def resume_command() -> str:
    return shlex.join(["mutator", *sys.argv[1:]])
