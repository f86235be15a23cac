"""`plan` and `run`: plan and run campaigns."""

import shlex
import sys
import warnings
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import counted, describe_seeds
from mutator.cli import completion
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import (
    AcceptVersions,
    Cluster,
    Engine,
    Exclude,
    InsecureNetwork,
    Json,
    Limit,
    Only,
    OutRun,
    Place,
    Reading,
    Seed,
    SeriesMb,
    ShardOf,
    with_place,
)
from mutator.cli.run_folders import show_counts
from mutator.errors import MutatorError
from mutator.execution.progress_text import duration

if TYPE_CHECKING:
    from mutator.api.runs import Run
    from mutator.campaigns.plan import Cost
    from mutator.execution.session import Notify, Summary
    from mutator.report.report_builder import WrittenReport

CampaignName = Annotated[
    str,
    typer.Argument(
        metavar="CAMPAIGN",
        help="Name of a campaign in the library, or a campaign file.",
        autocompletion=completion.campaigns,
    ),
]

ONE_PER_CORE = "Default: one per usable core."


def register(app: typer.Typer) -> None:
    app.command("plan", epilog=PLAN_EXAMPLES)(plan)
    app.command("run", epilog=RUN_EXAMPLES)(run)


PLAN_EXAMPLES = """\b
Examples:
  mutator plan quickstart --out runs/first
  mutator plan quickstart --out runs/chaff --only 'fault_type == "chaff"' -n 4
"""


@with_place
def plan(
    campaign: CampaignName,
    out: OutRun,
    workers: Annotated[
        int | None,
        typer.Option("-n", "--workers", min=1, help=f"Estimate for this many workers. {ONE_PER_CORE}"),
    ] = None,
    only: Only = None,
    exclude: Exclude = None,
    limit: Limit = None,
    seed: Seed = None,
    reading: Reading = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Freeze a campaign's experiments without running any.

    Prints the expected time and disk space. `run` with the same folder then runs exactly these experiments.
    """
    from mutator.api.plans import not_forkable

    terminal = Terminal(as_json)
    workspace = place.workspace()
    chosen = mutator.Choices(seed=seed, reading=reading, only=only, exclude=exclude, limit=limit)
    with terminal.wait("planning"):
        made = mutator.plan(campaign, out, choices=chosen, workspace=workspace)
    folder = out.resolve()
    anew = not_forkable(made, workspace)
    cost = made.cost(workers or usable_cores())
    if as_json:
        _emit_plan(terminal, folder, made, cost, anew)
    _print_plan(terminal, made, cost, anew)
    terminal.say(f"plan: {short_path(folder / 'plan.csv')} (digest {made.digest[:16]})")
    command = ["mutator", "run", campaign, "--out", str(out), *(["-n", str(workers)] if workers else [])]
    terminal.say(f"run it: {shlex.join(command)}", whole=True)


def _emit_plan(
    terminal: Terminal, folder: Path, made: "mutator.Plan", cost: "Cost", anew: dict[str, str]
) -> None:
    kinds = [
        {"module": m, "fault_type": f, "method": how, "experiments": n}
        for (m, f, how), n in sorted(made.groups().items())
    ]
    facts = {"run": str(folder), "digest": made.digest, "seed": made.seed, "reading": made.reading}
    facts |= {"seeds": [made.seeds[0], made.seeds[-1]]} if len(made.seeds) > 1 else {}
    facts |= {"experiments": len(made.experiments), "runs": made.runs, "groups": kinds, "cost": cost}
    terminal.emit(facts | {"not_forked": anew})


def _print_plan(terminal: Terminal, made: "mutator.Plan", cost: "Cost", anew: dict[str, str]) -> None:
    groups = sorted(made.groups().items())
    rows = [(f"{module}/{kind}", method, n) for (module, kind, method), n in groups]
    terminal.table(
        ["fault type", "method", "experiments"],
        [*rows, ("total", "", len(made.experiments))],
        right=(2,),
        total=True,
    )
    for text in made.told:
        terminal.say(text)
    if len(made.seeds) > 1:
        terminal.say(
            f"{describe_seeds(made.seeds)}: {len(made.goldens())} golden runs (each seed has its own)"
        )
    if shared := len(made.experiments) - made.runs:
        terminal.say(f"runs: {made.runs}; experiments that reuse another scenario's identical run: {shared}")
    for why, variants in _by_reason(anew).items():
        terminal.say(f"only the reference engine can run {', '.join(variants)}: {why}")
    terminal.say(f"expected: {_cost_line(cost)}")


def _by_reason(found: dict[str, str]) -> dict[str, list[str]]:
    return {why: [name for name in found if found[name] == why] for why in found.values()}


def _cost_line(cost: "Cost") -> str:
    source = "measured in this folder" if cost.measured else "estimated with a default time per run"
    time, disk = duration(cost.wall_s), cost.disk_bytes / 1e6
    who = counted(cost.workers, "worker")
    return f"{time} with {who} ({duration(cost.cpu_s)} of CPU), {disk:.0f} MB of disk; {source}"


RUN_EXAMPLES = """\b
Examples:
  mutator run quickstart --out runs/first
  mutator run my_campaign.yaml --out runs/mine --limit 20
  mutator run quickstart --out runs/part1 --shard 1/3 -n 4
  mutator run paper --out runs/paper --cluster tls://10.0.0.5:8786
  mutator run quickstart --out runs/s1 --only 'scenario == "S1" and method == "guided"'

The same command resumes an interrupted or killed run.
"""


@with_place
def run(
    campaign: CampaignName,
    out: OutRun,
    workers: Annotated[
        int | None,
        typer.Option(
            "-n", "--workers", min=0, help=f"Worker processes; 0: only this process. {ONE_PER_CORE}"
        ),
    ] = None,
    only: Only = None,
    exclude: Exclude = None,
    limit: Limit = None,
    seed: Seed = None,
    reading: Reading = None,
    shard: ShardOf = None,
    series_mb: SeriesMb = None,
    engine: Engine = None,
    reviewed: Annotated[
        bool,
        typer.Option(
            "--require-reviewed", help="Refuse to run unless `mutator review` approved every mutant."
        ),
    ] = False,
    accept_versions: AcceptVersions = False,
    cluster: Cluster = None,
    insecure_network: InsecureNetwork = False,
    stills: Annotated[
        bool,
        typer.Option(
            help="Rerun the worst camera experiments to add stills to the report: one in 20, at most ten. "
            "Takes about two minutes."
        ),
    ] = True,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Run or resume a campaign; print its results and write its report."""
    from mutator.cli.progress_display import campaign_progress

    terminal = Terminal(as_json)
    workspace = place.workspace()
    chosen = mutator.Choices(seed=seed, reading=reading, only=only, exclude=exclude, limit=limit, shard=shard)
    chosen = replace(chosen, series_mb=series_mb)
    workers = usable_cores() if workers is None else workers
    try:
        with campaign_progress(terminal) as notify, warnings.catch_warnings():
            warnings.simplefilter("ignore", mutator.IncompleteRun)  # `_print_end` reports it
            made = mutator.run(
                campaign,
                out,
                choices=chosen,
                workers=workers,
                engine=engine,
                reviewed=reviewed,
                accept_versions=accept_versions,
                cluster=cluster,
                insecure_network=insecure_network,
                progress=notify,
                workspace=workspace,
            )
            if stills and made.summary and made.summary.exit_code == 0:
                _take_stills(terminal, made, notify, workers)
            written = _report(out, made, notify)
    except KeyboardInterrupt:
        raise typer.Abort(f"interrupted; finished experiments are kept; resume: {resume_command()}") from None
    assert made.summary is not None  # `mutator.run` always sets it
    _print_end(terminal, out, made, made.summary, written)
    if made.summary.exit_code:
        raise typer.Exit(made.summary.exit_code)


def _take_stills(terminal: Terminal, run: "Run", notify: "Notify", workers: int) -> None:
    if problem := run.take_stills(notify, workers=workers):
        terminal.note(f"no stills of {problem}")


def _report(out: Path, run: "Run", notify: "Notify") -> "WrittenReport | None":
    if not (run.summary and run.summary.results):
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


def _print_end(
    terminal: Terminal, out: Path, run: "Run", summary: "Summary", written: "WrittenReport | None"
) -> None:
    report = (
        [out / path.relative_to(run.path) for path in (written.markdown, written.page)] if written else []
    )
    if terminal.as_json:
        counts = {"planned": summary.planned, "done": summary.done, "ran": summary.ran}
        paths = {"run": str(out), "report": str(report[0]) if report else None}
        errors = [{"experiment": i, "detail": d} for i, d in summary.harness_errors]
        found = {"outcomes": summary.outcomes, "harness_errors": errors, "proof": summary.proof}
        terminal.emit(counts | paths | found | asdict(summary.seals) | {"not_forked": summary.not_forked})
    if written:
        show_counts(terminal, run)
    terminal.say(
        f"{summary.done} of {summary.planned} experiments done, {summary.ran} now; "
        f"checks, experiments and proof took {duration(summary.elapsed_s)}"
    )
    if summary.proof_note:
        terminal.say(f"proof: {summary.proof_note}")
    if written:
        terminal.say(f"report: {report[0]} and {report[1]}")
    for name, value in summary.seals.texts().items():
        terminal.say(f"{name}: {value}")
    if summary.harness_errors:
        terminal.say(
            f"harness errors: {len(summary.harness_errors)} (not in rates; the same command retries them)"
        )
        for name, detail in summary.harness_errors[:5]:
            terminal.say(f"  {name}: {detail}", style="red")
    if summary.problem:
        terminal.complain(summary.problem)
    if summary.interrupted or summary.done < summary.planned:
        terminal.say(f"resume: {resume_command()}", style="bold", whole=True)


def resume_command() -> str:
    return shlex.join(["mutator", *sys.argv[1:]])
