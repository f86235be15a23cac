"""One experiment printed: what was injected, what happened when, what became of it."""

from pathlib import Path
from typing import TYPE_CHECKING

from mutator.api.experiment_results import describe, verdict
from mutator.api.runs import load_run, newest_run
from mutator.cli.console import STYLES, Terminal
from mutator.mutants.readable_diffs import readable

if TYPE_CHECKING:
    from mutator.api.runs import RunExperiment
    from mutator.api.trials import Trial
    from mutator.model import Experiment, Record
    from mutator.workspace import Workspace


def find_experiment(workspace: "Workspace", run: Path | None, prefix: str) -> "RunExperiment":
    """The one experiment whose id starts with `prefix` in `run`, or in the newest run."""
    return load_run(run or newest_run(workspace.library.parent), workspace=workspace).experiment(prefix)


def print_experiment(terminal: Terminal, experiment: "Experiment", patch: str) -> None:
    """Heading, what was asked for, and the diff."""
    facts = describe(experiment)
    width = max(len(name) for name in facts)
    for name, value in facts.items():
        terminal.say(f"{name.ljust(width)}  {value}", style="bold" if name == "fault" else None)
    terminal.say()
    diff, note = readable(patch)
    terminal.diff(diff)
    terminal.say(note, style="dim")
    terminal.say()


def print_verdict(terminal: Terminal, record: "Record") -> None:
    """The verdict and a table of what happened when, counted from the activation."""
    ending = record.outcome.value if record.outcome else record.status.value
    terminal.say(f"verdict: {ending}", style=STYLES.get(ending))
    if record.detail:
        terminal.say(record.detail)
    start = record.activation.first if record.activation else None
    events = _events(record)
    if events:
        rows = [
            (f"{t:.2f}", "" if start is None else f"{t - start:+.2f}", what)
            for t, what in sorted(events, key=lambda e: e[0])
        ]
        terminal.table(["time [s]", "from activation [s]", "what"], rows, right=(0, 1))
    time_left = verdict(record)["reaction_time_s"]
    if time_left is not None:
        terminal.say(f"reaction time (first hazard - first alert): {time_left:.2f} s")
    deviations = ", ".join(f"{name} {value:.4g}" for name, value in record.max_dev)
    if deviations:
        terminal.say(f"largest difference from golden: {deviations}")


def _events(record: "Record") -> list[tuple[float, str]]:
    events: list[tuple[float, str]] = []
    if record.activation:
        times = record.activation.count
        events.append((record.activation.first, f"fault active first ({times} times in all)"))
        events.append((record.activation.last, "fault active last"))
    if record.t_manifest is not None:
        events.append((record.t_manifest, "manifested: an actuator differs from golden"))
    events += [(t, f"alert {name}") for name, t in record.alerts]
    events += [(t, f"hazard {name}") for name, t in record.hazards]
    return events


def show_trial(terminal: Terminal, trial: "Trial") -> None:
    """Everything about an experiment that was just run alone; its plot goes beside its traces."""
    with terminal.wait("drawing"):
        drawn = trial.save_plot(trial.folder / "plot.svg")
    if terminal.as_json:
        facts = {**describe(trial.experiment), **verdict(trial.record), "patch": trial.patch}
        facts |= {"golden_hazards_s": dict(trial.golden_hazards)}
        terminal.emit(facts | {"traces": str(trial.single.faulty), "plot": str(drawn) if drawn else None})
        return
    print_experiment(terminal, trial.experiment, trial.patch)
    print_verdict(terminal, trial.record)
    if trial.golden_hazards:
        reached = ", ".join(f"{name} at {t:.2f} s" for name, t in trial.golden_hazards)
        terminal.say(f"the fault-free run reaches {reached} itself: that need not be the fault's doing")
    if trial.log.strip() and trial.record.detail:
        terminal.say("last lines of the run:")
        terminal.say(trial.log.strip())
    terminal.say(f"plot: {drawn}" if drawn else "no plot: the run left no trace")
