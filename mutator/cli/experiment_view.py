"""One experiment shown: what was injected, when things happened, what became of it, golden against faulty."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator.cli import choose
from mutator.cli.console import STYLES, Terminal, short_path
from mutator.errors import MutatorError
from mutator.mutants.readable_diffs import readable

if TYPE_CHECKING:
    from mutator.campaigns.plans import Plan
    from mutator.execution.single_run import Single
    from mutator.model import Experiment, Record
    from mutator.store.run_folder import RunFolder
    from mutator.targets.manifest import TargetManifest
    from mutator.workspace import Workspace


@dataclass(frozen=True, kw_only=True)
class Found:
    """An experiment of a run folder; `record` is None before it was run."""

    folder: "RunFolder"
    plan: "Plan"
    experiment: "Experiment"
    record: "Record | None"


def find_experiment(workspace: "Workspace", run: Path | None, prefix: str) -> Found:
    """The one experiment whose id starts with `prefix` in `run`, or in the newest run."""
    from mutator.campaigns.plans import load_plan
    from mutator.store.records import read_records
    from mutator.store.run_folder import RunFolder

    folder = RunFolder.open(choose.find_run(run, workspace.library.parent))
    wanted = folder.find(prefix)
    plan = load_plan(folder.path)
    experiment = next(e for e in plan.experiments if e.id == wanted)
    record = read_records(folder.path).get(wanted)
    return Found(folder=folder, plan=plan, experiment=experiment, record=record)


def experiment_patch(workspace: "Workspace", found: Found) -> str:
    """The source diff of an experiment: the kept one, or made now when it has not run yet."""
    kept = found.folder.patch(found.experiment.id)
    if kept.exists():
        return kept.read_bytes().decode("utf-8", "surrogateescape")
    from mutator.mutants.building import build

    manifest = workspace.manifest(found.plan.campaign.target)
    e = found.experiment
    return build(manifest, workspace.fault_models(), e.fault, e.trigger).patch


def describe(experiment: "Experiment") -> dict[str, Any]:
    """What the experiment is, for people and as JSON."""
    fault, trigger = experiment.fault, experiment.trigger
    hold = fault.hold or trigger.hold
    return {
        "experiment": experiment.id,
        "fault": fault.label,
        "aim": fault.aim,
        "reading": fault.reading,
        "scenario": " ".join((experiment.scenario, *experiment.changes)),
        "method": experiment.method.value,
        "trigger": f"{trigger.name}: {trigger.condition}",
        "armed_after_s": trigger.armed_after_s,
        "hold": hold.value,
        "seed": experiment.seed,
    }


def verdict(record: "Record") -> dict[str, Any]:
    """What became of it, for people and as JSON. Times in s of simulation; None: did not happen."""
    from mutator.outcomes.verdicts import reaction_time

    activation = record.activation
    return {
        "status": record.status.value,
        "outcome": record.outcome.value if record.outcome else None,
        "detail": record.detail,
        "activated_s": activation.first if activation else None,
        "active_until_s": activation.last if activation else None,
        "activations": activation.count if activation else 0,
        "manifested_s": record.t_manifest,
        "hazards_s": dict(record.hazards),
        "alerts_s": dict(record.alerts),
        "reaction_time_s": reaction_time(record.hazards, record.alerts),
        "largest_difference": dict(record.max_dev),
        "trace_digest": record.trace_digest,
    }


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


def draw(manifest: "TargetManifest", single: "Single", plot: Path) -> Path | None:
    """Draw golden against faulty into `plot`; None when the faulty run left no trace."""
    from mutator.figures.run_plot import marks_of, plot_run
    from mutator.outcomes.golden import load_trace

    if not (single.faulty / manifest.trace_file).exists():
        return None
    facts = describe(single.experiment)
    plot_run(
        load_trace(manifest, single.golden),
        load_trace(manifest, single.faulty),
        manifest,
        title=f"{facts['fault']}   {facts['scenario']}   {facts['trigger']}   [{single.experiment.id}]",
        marks=marks_of(single.record),
        paths=[plot],
    )
    return plot


def keep_plot(manifest: "TargetManifest", single: "Single", folder: "RunFolder", plot: Path) -> Path | None:
    """Draw into `plot`, and leave the series where the report's page finds them; None as `draw`."""
    from mutator.outcomes.golden import load_trace
    from mutator.report import series as report_series

    drawn = draw(manifest, single, plot)
    if drawn:
        golden, faulty = (load_trace(manifest, out) for out in (single.golden, single.faulty))
        report_series.keep(folder, manifest, golden, faulty, single.record)
    return drawn


def show_single(terminal: Terminal, manifest: "TargetManifest", single: "Single", *, plot: Path) -> None:
    """Everything about an experiment that was just run alone."""
    patch = single.mutant.patch if single.mutant else ""
    with terminal.wait("drawing"):
        drawn = draw(manifest, single, plot)
    if terminal.as_json:
        facts = {**describe(single.experiment), **verdict(single.record), "patch": patch}
        terminal.emit(facts | {"traces": str(single.faulty), "plot": str(drawn) if drawn else None})
        return
    print_experiment(terminal, single.experiment, patch)
    print_verdict(terminal, single.record)
    if single.log.strip() and single.record.detail:
        terminal.say("last lines of the run:")
        terminal.say(single.log.strip())
    terminal.say(f"plot: {drawn}" if drawn else "no plot: the run left no trace")


def not_run(found: Found) -> MutatorError:
    """What to say of an experiment that is planned only."""
    return MutatorError(
        f"experiment {found.experiment.id} has not run yet",
        where=found.folder.path,
        remedy=f"run it: `mutator run {found.plan.campaign.name} --out {short_path(found.folder.path)}`",
    )
