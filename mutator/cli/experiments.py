"""`show` and `rerun`: one experiment of a run."""

import math
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator.cli import completion
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import ExperimentId, Json, Place, Run, with_place
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.api.run_experiments import RunExperiment
    from mutator.api.stored_experiments import StoredExperiment

DIFFERS = "the new run differs from the campaign's record: see `mutator rerun`"


def register(app: typer.Typer) -> None:
    app.command("show", epilog=SHOW_EXAMPLES)(show)
    app.command("rerun", epilog=RERUN_EXAMPLES)(rerun)


SHOW_EXAMPLES = """\b
Examples:
  mutator show 3f9a                          an experiment of the newest run in runs/
  mutator show 3f9a --run runs/first --plot  plot it, too
  mutator show                               the ten worst experiments
  mutator show --only 'severity >= "S2"' --limit 30
  mutator show 3f9a --patch | (cd target && patch -p1)
  mutator show 3f9a --drive                  rerun it, and keep trace, series and plot
  mutator show 3f9a --video 3f9a.mp4         rerun and film the golden and the faulty run
  mutator show 3f9a --still 14.5             one frame of the film, for the report
  mutator show 3f9a --still 14.5=early.png --still 20=late.png
"""


@with_place
def show(
    experiment: Annotated[
        str | None,
        typer.Argument(
            metavar="[EXPERIMENT]",
            help="An experiment's id, or the start of the id. Default: list the worst.",
            show_default=False,
            autocompletion=completion.experiments,
        ),
    ] = None,
    run: Run = None,
    plot: Annotated[
        bool,
        typer.Option(help="Plot the golden and the faulty run; rerun the experiment if no trace was kept."),
    ] = False,
    drive: Annotated[
        bool, typer.Option("--drive", help="Rerun the experiment, and keep trace, series and plot.")
    ] = False,
    video: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Film the golden and the faulty run side by side: a .mp4 or .gif."),
    ] = None,
    still: Annotated[
        list[str] | None,
        typer.Option(
            metavar="T=FILE", help="One frame of the film, at T seconds: a .png or .jpg; repeatable."
        ),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(metavar="EXPR", help="List only experiments whose results match, e.g. 'delta_v > 5'."),
    ] = None,
    limit: Annotated[int, typer.Option(min=1, help="List at most this many experiments.")] = 10,
    patch_alone: Annotated[
        bool,
        typer.Option("--patch", help="Print only the whole patch, including the probe."),
    ] = False,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Show an experiment: diff, times, verdict, path of the fault.

    Reads what the run folder stores. With --drive, --plot, --video or --still, also reruns the experiment
    and writes into the run folder. Without an experiment, lists the worst ones of a run, by severity class,
    delta-v and margin.
    """
    from mutator.cli import experiment_view

    terminal = Terminal(as_json)
    if experiment is None:
        experiment_view.list_worst(terminal, place.workspace(), run, only, limit)
        return
    workspace = place.workspace()
    found = experiment_view.stored_experiment(workspace, run, experiment)
    patch = found.patch
    if patch_alone:
        terminal.diff(patch)
        return
    drawn, filmed = found.plot_file if found.is_drawn else None, list[Path]()
    if drive or plot or video or still:
        drivable = experiment_view.find_experiment(workspace, run, experiment)
        if (drive or plot) and found.record:
            drawn = _plot(terminal, drivable, anew=drive)
        filmed = _film(terminal, drivable, video, still or [])
    if as_json:
        terminal.emit(_facts(found, patch, drawn) | {"films": filmed})
    _print(terminal, found, patch)
    if drawn:
        terminal.link("plot", drawn)
    for path in filmed:
        terminal.link("film", path)
    if found.record and not drawn and not filmed:
        terminal.say(f"no plot is stored; to rerun and plot it: {_plot_command(found)}", whole=True)


def _plot_command(found: "StoredExperiment") -> str:
    return shlex.join(["mutator", "show", found.id, "--run", short_path(found.run.path), "--plot"])


def _facts(found: "StoredExperiment", patch: str, drawn: Path | None) -> dict[str, object]:
    from mutator.api.experiment_results import describe

    facts = {**describe(found.experiment), **found.verdict, "patch": patch}
    facts |= {"run": str(found.run.path), "plot": str(drawn) if drawn else None}
    facts |= {"run_with": found.stretch, "has_series": found.has_series}
    return facts | {"path": asdict(found.fault_path) if found.fault_path else None}


def _print(terminal: Terminal, found: "StoredExperiment", patch: str) -> None:
    from mutator.cli import experiment_view

    experiment_view.print_experiment(terminal, found.experiment, patch)
    if found.record is None:
        terminal.say(str(found.not_run()))
    else:
        experiment_view.print_verdict(terminal, found)
        experiment_view.print_path(terminal, found)
    if found.stretch:
        terminal.say(f"recorded on: {found.stretch}")


def _plot(terminal: Terminal, found: "RunExperiment", *, anew: bool) -> Path | None:
    if found.is_drawn and not anew:
        return found.plot_file
    with terminal.wait("rerunning" if anew else "no trace was kept: rerunning"):
        trial = found.rerun(keep=True)
    if trial.same_as_record is False:
        terminal.note(DIFFERS)
    return found.plot_file if trial.has_trace else None


def _film(terminal: Terminal, found: "RunExperiment", video: Path | None, stills: list[str]) -> list[Path]:
    shots = [_still(text, found) for text in stills]
    shots += [mutator.Shot(out=video)] if video else []
    if not shots:
        return []
    with terminal.wait("rerunning and filming"):
        same = found.film(shots)
    if not same:
        terminal.note(DIFFERS)
    return [shot.out for shot in shots]


def _still(text: str, found: "RunExperiment") -> "mutator.Shot":
    """Parse `T=FILE` or `T`. With `T` alone, the file goes next to the plots, where the report finds it."""
    t, named, name = text.partition("=")
    try:
        time = float(t)
    except ValueError:
        time = math.nan
    if not math.isfinite(time) or (named and not name):
        raise MutatorError(
            f"'{text}'", where="--still", expected="a time in s, alone or with a file: 14.5 or 14.5=early.png"
        )
    kept = found.plot_file.with_name(f"{found.id}-{time:.2f}s.jpg")
    return mutator.Shot(out=Path(name) if name else kept, t=time)


RERUN_EXAMPLES = """\b
Examples:
  mutator rerun 3f9a                    compare the new result with the record
  mutator rerun 3f9a --trace            also keep trace and plot, which the report's page then shows
"""


@with_place
def rerun(
    experiment: ExperimentId,
    trace: Annotated[bool, typer.Option("--trace", help="Keep trace and plot in the run folder.")] = False,
    run: Run = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Rerun one experiment and compare the result.

    The exit code is 1 if the new record differs from the campaign's record.
    """
    from mutator.api.experiment_results import describe
    from mutator.cli import experiment_view

    terminal = Terminal(as_json)
    found = experiment_view.find_experiment(place.workspace(), run, experiment)
    with terminal.wait(f"rerunning {found.experiment.scenario}"):
        trial = found.rerun(keep=trace)
    same, traces = trial.same_as_record, trial.single.faulty
    plot = found.plot_file if trace and trial.has_trace else None
    if as_json:
        facts = {**describe(found.experiment), **trial.verdict, "same_as_record": same}
        terminal.emit(facts | {"traces": str(traces) if trace else None, "plot": str(plot) if plot else None})
    experiment_view.print_verdict(terminal, trial)
    terminal.result(_comparison(same), style="bold red" if same is False else None)
    if trace:
        terminal.say(f"trace: {short_path(traces)}")
        terminal.say(f"plot: {short_path(plot)}" if plot else "no plot: the run left no trace")
    if same is False:
        raise typer.Exit(EXIT_CHECK_FAILED)


def _comparison(same: bool | None) -> str:
    if same is None:
        return "no record to compare with: the campaign has not run this experiment yet"
    return (
        "the same as the campaign's record, byte for byte" if same else "DIFFERS from the campaign's record"
    )
