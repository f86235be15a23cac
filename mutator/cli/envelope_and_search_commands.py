"""`envelope` and `search`: how large and how long a fault may be before a hazard follows."""

import shlex
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import counted
from mutator.cli import shell_completion
from mutator.cli.envelope_printing import print_envelopes
from mutator.cli.plan_and_run_commands import WORKERS_DEFAULT_HELP
from mutator.cli.shared_options import (
    Cluster,
    Engine,
    InsecureNetwork,
    Json,
    OutRunFolder,
    Reading,
    Seed,
    Wide,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path
from mutator.execution.progress_text import describe_outcomes

if TYPE_CHECKING:
    from mutator.execution.session_summary import Summary

Specs = Annotated[
    list[str],
    typer.Argument(
        metavar="SPEC...",
        help="Names of specs or variants in the library; `*` is a wildcard.",
        autocompletion=shell_completion.complete_specs,
    ),
]
Scenarios = Annotated[
    list[str],
    typer.Option(
        "--scenario",
        "-s",
        metavar="NAME",
        help="A driving scenario. Can be given several times.",
        autocompletion=shell_completion.complete_scenarios,
    ),
]
Starts = Annotated[
    list[str],
    typer.Option(
        "--at",
        metavar="WHEN",
        help="When faults begin: a time in s, or a context (C1): the first time that the golden run is in "
        "it. Can be given several times.",
    ),
]
LongestS = Annotated[
    float, typer.Option("--longest-s", min=0.01, metavar="SECONDS", help="The longest duration.")
]
CampaignOfBench = Annotated[
    str | None,
    typer.Option(
        "--campaign",
        metavar="NAME",
        help="Take target, canary and limits from this campaign.",
        autocompletion=shell_completion.complete_campaigns,
    ),
]
Workers = Annotated[
    int | None, typer.Option("-n", "--workers", min=1, help=f"Worker processes. {WORKERS_DEFAULT_HELP}")
]

EXAMPLES = """\b
Examples:
  mutator envelope car_sensors/speed/slower --scenario S5_long --at 12 --out runs/speed
  mutator envelope 'radar/*' --scenario S1 --scenario S5 --at C1 --at 8 --out runs/radar
  mutator envelope car_sensors/steer --scenario S1 --at 5 --out runs/steer --budget-s 60

The same command goes on with what is unfinished. Without a hazard, a drive that ends less than --observe-s
after the fault decides nothing: choose a longer scenario.
"""


def register(app: typer.Typer) -> None:
    app.command("envelope", epilog=EXAMPLES)(envelope)
    app.command("search", epilog=SEARCH_EXAMPLES)(search)


@with_workspace_options
def envelope(
    specs: Specs,
    scenarios: Scenarios,
    starts: Starts,
    out: OutRunFolder,
    points: Annotated[
        int, typer.Option(min=2, max=200, help="At most this many magnitudes, and durations.")
    ] = 51,
    longest_s: LongestS = 15.0,
    observe_s: Annotated[
        float,
        typer.Option(
            "--observe-s",
            min=0,
            metavar="SECONDS",
            help="How long a drive must go on after a fault to count as without hazard.",
        ),
    ] = 15.0,
    validation: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="Drive N cells of each plane, drawn from undriven ones called without hazard; 0: none. "
            "86 without a hazard show that at most 5 % of these are hazardous, 436 that at most 1 % are.",
        ),
    ] = 86,
    seeds: Annotated[
        int,
        typer.Option(min=1, max=100, metavar="N", help="Drive each cell N times if its fault is random."),
    ] = 3,
    are_challenged: Annotated[
        bool,
        typer.Option(
            "--challengers/--no-challengers",
            help="Drive errors that change, as large as the constant ones that are survived: with "
            "alternating sign, a ramp, noise, a repeated glitch.",
        ),
    ] = True,
    budget_s: Annotated[
        float | None,
        typer.Option("--budget-s", min=0, metavar="SECONDS", help="Begin no batch after this time."),
    ] = None,
    campaign: CampaignOfBench = None,
    workers: Workers = None,
    seed: Seed = None,
    reading: Reading = None,
    engine: Engine = None,
    cluster: Cluster = None,
    insecure_network: InsecureNetwork = False,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Find how large and how long faults may be before a hazard follows.

    For each fault, scenario and start, a search finds the border between faults that are survived and
    faults that are not, by magnitude and duration. A validation then drives faults that were drawn from those
    called survived. What is called survived must also survive challengers: errors that change.
    """
    from mutator.api.explorations import DEFAULT_CHALLENGERS
    from mutator.api.explorations import envelope as find_envelopes
    from mutator.cli.progress_display import campaign_progress

    terminal = Terminal(as_json, wide)
    with warnings.catch_warnings(), campaign_progress(terminal) as show_progress:
        warnings.simplefilter("ignore", mutator.MutatorWarning)  # the exit code and the summary say it
        envelopes = find_envelopes(
            specs,
            scenarios,
            starts,
            out,
            points=points,
            longest_s=longest_s,
            observe_s=observe_s,
            validation=validation,
            seeds=seeds,
            challengers=DEFAULT_CHALLENGERS if are_challenged else (),
            budget_s=budget_s,
            campaign=campaign,
            workers=usable_cores() if workers is None else workers,
            seed=seed or 0,
            reading=reading,
            engine=engine,
            cluster=cluster,
            insecure_network=insecure_network,
            progress=show_progress,
            workspace=workspace_options.workspace(),
        )
    if as_json:
        terminal.print_json([plane.as_json() for plane in envelopes])
    else:
        print_envelopes(terminal, envelopes)
        if envelopes.note:
            terminal.print_note(envelopes.note)
        _print_end(terminal, envelopes.summary, out)
    _exit_as(envelopes.summary)


SEARCH_EXAMPLES = """\b
Examples:
  mutator search 'car_sensors/*' 'radar/*' -s S1 -s S5 --at 5 --at 12 --budget 300 --out runs/search
"""


@with_workspace_options
def search(
    specs: Specs,
    scenarios: Scenarios,
    starts: Starts,
    out: OutRunFolder,
    budget: Annotated[int, typer.Option(min=1, metavar="N", help="The number of runs.")] = 300,
    strategy: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="`planes` learns from results; `random` draws faults, to compare with."
        ),
    ] = "planes",
    longest_s: LongestS = 15.0,
    campaign: CampaignOfBench = None,
    workers: Workers = None,
    seed: Seed = None,
    reading: Reading = None,
    engine: Engine = None,
    cluster: Cluster = None,
    insecure_network: InsecureNetwork = False,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Search small and short faults that cause hazards, among many faults, scenarios and starts.

    The search learns which faults lead to hazards, and drives what promises most: new faults, or smaller and
    shorter ones. It finds bounds: a smaller fault that it did not try can cause the same hazard.
    """
    from mutator.api.explorations import search as find_hazards
    from mutator.cli.progress_display import campaign_progress
    from mutator.explore.envelope_texts import findings_table

    terminal = Terminal(as_json, wide)
    with warnings.catch_warnings(), campaign_progress(terminal) as show_progress:
        warnings.simplefilter("ignore", mutator.MutatorWarning)  # the exit code and the summary say it
        findings = find_hazards(
            specs,
            scenarios,
            starts,
            out,
            budget=budget,
            strategy=strategy,  # type: ignore[arg-type]  # it is checked there
            longest_s=longest_s,
            campaign=campaign,
            workers=usable_cores() if workers is None else workers,
            seed=seed or 0,
            reading=reading,
            engine=engine,
            cluster=cluster,
            insecure_network=insecure_network,
            progress=show_progress,
            workspace=workspace_options.workspace(),
        )
    table = findings_table(findings, findings.planes)
    if as_json:
        terminal.print_json([dict(zip(table.heads, row, strict=True)) for row in table.rows])
    else:
        terminal.print_text(
            f"{counted(len(findings), 'finding')} in {counted(len(findings.planes), 'plane')}"
        )
        if findings.summary and findings.summary.planned < budget:
            terminal.print_note(
                f"the search ended after {findings.summary.planned:,} of {budget:,} runs: it knows no cell "
                "that it would drive next"
            )
        terminal.print_table(
            table.heads, table.rows, right_aligned=list(table.right_aligned), last_is_whole=True
        )
        _print_end(terminal, findings.summary, out)
    _exit_as(findings.summary)


def _exit_as(summary: "Summary | None") -> None:
    if summary and summary.exit_code:
        raise typer.Exit(summary.exit_code)


def _print_end(terminal: Terminal, summary: "Summary | None", out: Path) -> None:
    if summary is None:
        return
    terminal.print_text()
    terminal.print_text(f"{counted(summary.done, 'experiment')}; {describe_outcomes(summary.outcomes)}")
    if summary.proof_note:
        terminal.print_text(f"proof: {summary.proof_note}")
    if summary.seal:
        terminal.print_text(f"seal: {summary.seal}")
    if summary.problem:
        terminal.print_error(summary.problem)
    terminal.print_command("all runs:", shlex.join(["mutator", "report", short_path(out)]))
