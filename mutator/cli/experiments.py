"""`show` and `rerun`: one experiment of a run."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mutator.cli.console import Terminal, short_path
from mutator.cli.options import ExperimentId, Json, Place, Run, with_place
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.cli.experiment_view import Found
    from mutator.report.film import Shot
    from mutator.workspace import Workspace


DIFFERS = "the new run differs from the campaign's record: see `mutator rerun`"


def register(app: typer.Typer) -> None:
    """Add the verbs to the command line."""
    app.command("show", epilog=SHOW_EXAMPLES)(show)
    app.command("rerun", epilog=RERUN_EXAMPLES)(rerun)


SHOW_EXAMPLES = """\b
Examples:
  mutator show 3f9a                          of the newest run in runs/
  mutator show 3f9a --run runs/first --no-plot
  mutator show 3f9a --video 3f9a.mp4         drives both runs again, with a film
  mutator show 3f9a --still 14.5             a picture of it, for the report
  mutator show 3f9a --still 14.5=early.png --still 20=late.png
"""


@with_place
def show(
    experiment: ExperimentId,
    run: Run = None,
    plot: Annotated[
        bool, typer.Option(help="Draw golden against faulty (drives it again if no trace was kept).")
    ] = True,
    video: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Film golden beside faulty: a .mp4 or .gif.")
    ] = None,
    still: Annotated[
        list[str] | None,
        typer.Option(
            metavar="T=FILE", help="One picture of that film, at T seconds: a .png or .jpg. May be repeated."
        ),
    ] = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Show diff, times, verdict, plot of golden against faulty; or watch them."""
    from mutator.cli import experiment_view as view

    terminal = Terminal(as_json)
    workspace = place.workspace()
    found = view.find_experiment(workspace, run, experiment)
    patch = view.experiment_patch(workspace, found)
    drawn = _plot(terminal, workspace, found) if plot and found.record else None
    filmed = _film(terminal, workspace, found, video, still or [])
    if as_json:
        outcome = view.verdict(found.record) if found.record else {"status": None}
        facts = {**view.describe(found.experiment), **outcome, "patch": patch}
        facts |= {"run": str(found.folder.path), "plot": str(drawn) if drawn else None}
        terminal.emit(facts | {"films": filmed})
        return
    view.print_experiment(terminal, found.experiment, patch)
    if found.record is None:
        terminal.say(str(view.not_run(found)))
    else:
        view.print_verdict(terminal, found.record)
    if drawn:
        terminal.say(f"plot: {short_path(drawn)}")
    for path in filmed:
        terminal.say(f"film: {short_path(path)}")


def _plot(terminal: Terminal, workspace: "Workspace", found: "Found") -> Path | None:
    """The experiment's plot, drawn from its kept trace, or from one made now."""
    from mutator.cli import experiment_view as view
    from mutator.execution.single_run import rerun as run_again
    from mutator.report.series import series_path

    plot = plot_path(found.folder.path, found.experiment.id)
    if plot.exists() and series_path(found.folder, found.experiment.id).exists():
        return plot
    with terminal.wait("no trace was kept: driving it again"):
        single, same = run_again(workspace, found.folder.path, found.experiment.id)
    if not same:
        terminal.note(DIFFERS)
    return view.keep_plot(workspace.manifest(found.plan.campaign.target), single, found.folder, plot)


def _film(
    terminal: Terminal,
    workspace: "Workspace",
    found: "Found",
    video: Path | None,
    stills: list[str],
) -> list[Path]:
    """Write the video and the stills that are wanted; returns their paths."""
    from mutator.cli import experiment_view as view
    from mutator.report.film import Shot, film_experiment

    shots = [_still(text, found) for text in stills]
    shots += [Shot(out=video)] if video else []
    if not shots:
        return []
    facts = view.describe(found.experiment)
    trigger = facts["trigger"].removesuffix(": True")
    title = f"{facts['fault']}   {facts['scenario']}   {trigger}"
    manifest = workspace.manifest(found.plan.campaign.target)
    with terminal.wait("driving it again with a film"):
        same = film_experiment(workspace, manifest, found.folder.path, found.experiment.id, title, shots)
    if not same:
        terminal.note(DIFFERS)
    return [shot.out for shot in shots]


def _still(text: str, found: "Found") -> "Shot":
    """The still of `T=FILE`, or of `T` alone: it is kept beside the plots, where the report finds it."""
    from mutator.report.film import Shot

    t, named, name = text.partition("=")
    try:
        time = float(t)
    except ValueError:
        time = math.nan
    if not math.isfinite(time) or (named and not name):
        raise MutatorError(
            f"'{text}'", where="--still", expected="a time in s, alone or with a file: 14.5 or 14.5=early.png"
        )
    kept = found.folder.path / "plots" / f"{found.experiment.id}-{time:.2f}s.jpg"
    return Shot(out=Path(name) if name else kept, t=time)


def plot_path(run: Path, experiment_id: str) -> Path:
    """Where the plot of an experiment is kept in a run folder."""
    return run / "plots" / f"{experiment_id}.svg"


RERUN_EXAMPLES = """\b
Examples:
  mutator rerun 3f9a                    is the result the same again?
  mutator rerun 3f9a --trace            the same, and keep its trace and plot, for the report's page, too
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
    """Drive one experiment again; is the result the same?

    Exit code 1 if the new record differs from the campaign's.
    """
    import shutil

    from mutator.cli import experiment_view as view
    from mutator.execution.single_run import rerun as run_again

    terminal = Terminal(as_json)
    workspace = place.workspace()
    found = view.find_experiment(workspace, run, experiment)
    kept_before = (found.folder.path / "traces" / found.experiment.id).is_dir()
    with terminal.wait(f"driving {found.experiment.scenario} again"):
        single, same = run_again(workspace, found.folder.path, found.experiment.id)
    plot = None
    if trace:
        manifest = workspace.manifest(found.plan.campaign.target)
        drawn = plot_path(found.folder.path, found.experiment.id)
        plot = view.keep_plot(manifest, single, found.folder, drawn)
    elif not kept_before:
        shutil.rmtree(single.faulty.parent)
    recorded = found.record is not None
    if as_json:
        facts = {**view.describe(found.experiment), **view.verdict(single.record)}
        facts |= {"same_as_record": same if recorded else None}
        terminal.emit(
            facts | {"traces": str(single.faulty) if trace else None, "plot": str(plot) if plot else None}
        )
    view.print_verdict(terminal, single.record)
    terminal.say(_comparison(recorded, same), style=None if same else "bold red")
    if trace:
        terminal.say(f"trace: {short_path(single.faulty)}")
        terminal.say(f"plot: {short_path(plot)}" if plot else "no plot: the run left no trace")
    if not same:
        raise typer.Exit(EXIT_CHECK_FAILED)


def _comparison(recorded: bool, same: bool) -> str:
    if not recorded:
        return "no record to compare with: the campaign has not run it yet"
    return (
        "the same as the campaign's record, byte for byte" if same else "DIFFERS from the campaign's record"
    )
