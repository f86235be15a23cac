"""`show` and `rerun`: one experiment of a run."""

import math
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator.cli import shell_completion
from mutator.cli.shared_options import (
    ExperimentId,
    Json,
    RunFolderOption,
    Wide,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.api.run_experiments import RunExperiment
    from mutator.api.stored_experiments import StoredExperiment

DIFFERS_NOTE = "the new run differs from the campaign's record: see `mutator rerun`"


def register(app: typer.Typer) -> None:
    app.command("show", epilog=SHOW_EXAMPLES)(show)
    app.command("rerun", epilog=RERUN_EXAMPLES)(rerun)


SHOW_EXAMPLES = """\b
Examples:
  mutator show 3f9a                          an experiment of the newest run in runs/
  mutator show 3f9a --run runs/first --plot  plot it, too
  mutator show                               the worst experiments of the ten worst causes
  mutator show --only 'severity >= "S2"' --limit 30
  mutator show 3f9a --patch | (cd target && patch -p1)
  mutator show 3f9a --drive                  rerun it, and keep trace, series and plot
  mutator show 3f9a --video 3f9a.mp4         rerun and film the golden and the faulty run
  mutator show 3f9a --still 14.5             one frame of the film, for the report
  mutator show 3f9a --still 14.5=early.png --still 20=late.png
  mutator show 3f9a --save regressions/radar.yaml   a test of plain pytest from now on
"""


@with_workspace_options
def show(
    experiment: Annotated[
        str | None,
        typer.Argument(
            metavar="EXPERIMENT",
            help="An experiment's id, or the start of the id. Default: list the worst.",
            show_default=False,
            autocompletion=shell_completion.complete_experiments,
        ),
    ] = None,
    run: RunFolderOption = None,
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
        typer.Option(
            metavar="EXPR",
            help="List only experiments whose results match, e.g. 'delta_v > 5'.",
            autocompletion=shell_completion.complete_result_columns,
        ),
    ] = None,
    limit: Annotated[int, typer.Option(min=1, help="List at most this many experiments.")] = 10,
    patch_alone: Annotated[
        bool,
        typer.Option("--patch", help="Print only the whole patch, including the probe."),
    ] = False,
    save: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Save the experiment for pytest: from then on, it must reach no other hazard.",
        ),
    ] = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show an experiment: diff, times, verdict, path of the fault.

    Reads what the run folder stores. With --drive, --plot, --video or --still, also reruns the experiment
    and writes into the run folder. Without an experiment, lists the worst of each cause (fault type and
    hazard): by severity class, silent hazards first, then by margin and time. With --only, lists each
    experiment.
    """
    from mutator.cli import experiment_printing

    terminal = Terminal(as_json, wide)
    if experiment is None:
        experiment_printing.print_worst_experiments(terminal, workspace_options.workspace(), run, only, limit)
        return
    workspace = workspace_options.workspace()
    stored = experiment_printing.find_stored_experiment(workspace, run, experiment)
    patch = stored.patch
    if patch_alone:
        terminal.print_diff(patch)
        return
    if save is not None:
        stored.save_regression(save)
    plot_path, film_paths = stored.plot_file if stored.is_drawn else None, list[Path]()
    if drive or plot or video or still:  # only this loads an engine
        run_experiment = experiment_printing.find_run_experiment(workspace, run, experiment)
        if (drive or plot) and stored.record:
            plot_path = _rerun_and_plot(terminal, run_experiment, anew=drive)
        film_paths = _rerun_and_film(terminal, run_experiment, video, still or [])
    if as_json:
        terminal.print_json(_experiment_facts(stored, patch, plot_path) | {"films": film_paths})
    _print_stored(terminal, stored, patch)
    if plot_path:
        terminal.print_link("plot", plot_path)
    for path in film_paths:
        terminal.print_link("film", path)
    if stored.record and not plot_path and not film_paths:
        words = ["mutator", "show", stored.id, "--run", short_path(stored.run.path), "--plot"]
        terminal.print_command("no plot is stored; to rerun and plot it:", shlex.join(words))


def _experiment_facts(
    experiment: "StoredExperiment", patch: str, plot_path: Path | None
) -> dict[str, object]:
    from mutator.api.experiment_results import experiment_facts

    facts = {**experiment_facts(experiment.experiment), **experiment.verdict, "patch": patch}
    facts |= {"run": str(experiment.run.path), "plot": str(plot_path) if plot_path else None}
    facts |= {
        "sentence": experiment.sentence,
        "run_with": experiment.stretch,
        "has_series": experiment.has_series,
    }
    if experiment.record and experiment.record.run_end:  # a run with defences
        facts |= {"defences": [asdict(activity) for activity in experiment.record.defences]}
    return facts | {"path": asdict(experiment.fault_path) if experiment.fault_path else None}


def _print_stored(terminal: Terminal, experiment: "StoredExperiment", patch: str) -> None:
    from mutator.cli import experiment_printing

    experiment_printing.print_ending_in_words(terminal, experiment)
    experiment_printing.print_experiment(terminal, experiment.experiment, patch)
    if experiment.record is None:
        terminal.print_text(str(experiment.not_run_error()))
    else:
        experiment_printing.print_verdict(terminal, experiment)
        experiment_printing.print_fault_path(terminal, experiment)
    if experiment.stretch:
        terminal.print_text(f"recorded on: {experiment.stretch}")


def _rerun_and_plot(terminal: Terminal, experiment: "RunExperiment", *, anew: bool) -> Path | None:
    if experiment.is_drawn and not anew:
        return experiment.plot_file
    with terminal.show_spinner("rerunning" if anew else "no trace was kept: rerunning"):
        trial = experiment.rerun(keep=True)
    if trial.same_as_record is False:
        terminal.print_note(DIFFERS_NOTE)
    return experiment.plot_file if trial.has_trace else None


def _rerun_and_film(
    terminal: Terminal, experiment: "RunExperiment", video: Path | None, stills: list[str]
) -> list[Path]:
    shots = [_parse_still(text, experiment) for text in stills]
    shots += [mutator.Shot(path=video)] if video else []
    if not shots:
        return []
    with terminal.show_spinner("rerunning and filming"):
        is_same = experiment.film(shots)
    if not is_same:
        terminal.print_note(DIFFERS_NOTE)
    return [shot.path for shot in shots]


def _parse_still(text: str, experiment: "RunExperiment") -> "mutator.Shot":
    """Parse `T=FILE` or `T`. With `T` alone, the file goes next to the plots, where the report finds it."""
    t, separator, name = text.partition("=")
    try:
        time = float(t)
    except ValueError:
        time = math.nan  # refused below, like infinity
    if not math.isfinite(time) or (separator and not name):
        raise MutatorError(
            f"'{text}'", where="--still", expected="a time in s, alone or with a file: 14.5 or 14.5=early.png"
        )
    default_path = experiment.plot_file.with_name(f"{experiment.id}-{time:.2f}s.jpg")
    return mutator.Shot(path=Path(name) if name else default_path, t=time)


RERUN_EXAMPLES = """\b
Examples:
  mutator rerun 3f9a                    compare the new result with the record
  mutator rerun 3f9a --trace            also keep trace and plot, which the report's page then shows
"""


@with_workspace_options
def rerun(
    experiment: ExperimentId,
    trace: Annotated[bool, typer.Option("--trace", help="Keep trace and plot in the run folder.")] = False,
    run: RunFolderOption = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Rerun one experiment and compare the result.

    The exit code is 1 if the new record differs from the campaign's record.
    """
    from mutator.api.experiment_results import experiment_facts
    from mutator.cli import experiment_printing

    terminal = Terminal(as_json, wide)
    run_experiment = experiment_printing.find_run_experiment(workspace_options.workspace(), run, experiment)
    with terminal.show_spinner(f"rerunning {run_experiment.experiment.scenario}"):
        trial = run_experiment.rerun(keep=trace)
    is_same, traces = trial.same_as_record, trial.single.faulty
    plot = run_experiment.plot_file if trace and trial.has_trace else None
    if as_json:
        facts = {**experiment_facts(run_experiment.experiment), **trial.verdict, "same_as_record": is_same}
        terminal.print_json(
            facts | {"traces": str(traces) if trace else None, "plot": str(plot) if plot else None}
        )
    experiment_printing.print_verdict(terminal, trial)
    terminal.print_result(_describe_comparison(is_same), style="bold red" if is_same is False else None)
    if trace:
        terminal.print_text(f"trace: {short_path(traces)}")
        terminal.print_text(f"plot: {short_path(plot)}" if plot else "no plot: the run left no trace")
    if is_same is False:
        raise typer.Exit(EXIT_CHECK_FAILED)


def _describe_comparison(is_same: bool | None) -> str:
    if is_same is None:
        return "no record to compare with: the campaign has not run this experiment yet"
    return (
        "the same as the campaign's record, byte for byte"
        if is_same
        else "DIFFERS from the campaign's record"
    )
