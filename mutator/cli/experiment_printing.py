"""Print one experiment: what was injected, what happened when, the verdict."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import mutator
from mutator._common import command_progress_events
from mutator._common.message_text import NO_BREAK_SPACE, counted
from mutator._common.phrase_texts import measured_number_text
from mutator.api.experiment_results import experiment_facts
from mutator.api.results_worst_first import worst_causes, worst_results
from mutator.api.stored_experiments import StoredExperiment, find_newest_run, open_stored_run
from mutator.cli.terminal_output import STYLE_BY_ENDING, Terminal, short_path
from mutator.errors import MutatorError
from mutator.mutants.patches_by_file import patch_without_new_files

if TYPE_CHECKING:
    from mutator.api.experiment_results import ExperimentResult
    from mutator.api.run_experiments import RunExperiment
    from mutator.api.trials import Trial
    from mutator.model import DefenceActivity, Experiment, Record
    from mutator.outcomes.fault_paths import PathComponent
    from mutator.results.result_rows import ResultRow
    from mutator.targets.manifest import TargetManifest
    from mutator.workspace import Workspace

_TIME_LABELS = {
    "time_to_hazard_s": "time to hazard (first hazard - activation)",
    "reaction_time_s": "reaction time (first hazard - first alert)",
}
# Columns of the worst experiments that are left out if no row has a value: few targets have classes, alerts.
_OPTIONAL_HEADS = ("severity", "delta-v [m/s]", "first alert", "more")
_NUMBER_HEADS = ("delta-v [m/s]", "margin", "more")


def find_stored_experiment(workspace: "Workspace", run: Path | None, id_start: str) -> StoredExperiment:
    """Find an experiment of a run, the newest by default, only to read what is stored about it."""
    return open_stored_run(run or find_newest_run(workspace.library.parent), workspace).experiment(id_start)


def find_run_experiment(workspace: "Workspace", run: Path | None, id_start: str) -> "RunExperiment":
    """Find an experiment of a run, the newest by default, which can be rerun."""
    return mutator.load_run(run or find_newest_run(workspace.library.parent), workspace=workspace).experiment(
        id_start
    )


def print_worst_experiments(
    terminal: Terminal, workspace: "Workspace", run: Path | None, only: str | None, limit: int
) -> None:
    folder = run or find_newest_run(workspace.library.parent)
    stored_run = open_stored_run(folder)
    length = terminal.id_length(stored_run.folder.experiment_ids())
    if only is None:
        causes, count = worst_causes(stored_run.path, limit)
        rows = [_cells_by_head(row, length) | {"more": more} for row, more in causes]
    else:
        worst_rows, count = worst_results(stored_run.path, only, limit)
        rows = [_cells_by_head(row, length) for row in worst_rows]
    if terminal.as_json:
        terminal.print_json({"run": str(folder), "count": count, "worst": rows})
        return
    scale = stored_run.folder.severity_scale
    if scale:
        rows = [row | {"severity": scale.labels.get(str(row["severity"]), "")} for row in rows]
    sentences = [(row["experiment"], row.pop("sentence")) for row in rows]
    has_more = any(row.get("more") for row in rows)
    rows = without_unused_columns(rows if has_more else [row | {"more": None} for row in rows])
    heads = tuple(rows[0]) if rows else ()
    terminal.print_table(
        heads,
        [tuple(row.values()) for row in rows],
        right_aligned=tuple(i for i, head in enumerate(heads) if head in _NUMBER_HEADS),
        priorities=[i for i, head in enumerate(heads) if head not in ("margin", "first alert")],
    )
    for name, sentence in sentences:
        terminal.print_text(f"{name}: {sentence}")
    terminal.print_text(
        f"{len(rows)} of {counted(count, 'experiment')} in {short_path(folder)}, the worst first"
    )
    if has_more:
        terminal.print_command(
            "more: experiments with the same fault type and hazard; to list them:",
            "mutator show --only 'fault_type == \"...\"'",
        )


def without_unused_columns(rows: list[dict[str, object]]) -> list[dict[str, object]]:
    """Return the rows of a table without the optional columns in which no row has a value."""
    unused = {head for head in _OPTIONAL_HEADS if all(row.get(head) in (None, "") for row in rows)}
    return [{head: cell for head, cell in row.items() if head not in unused} for row in rows]


def _cells_by_head(row: "ResultRow", id_length: int | None) -> dict[str, object]:
    return {
        "experiment": row.experiment_id[:id_length],
        "ending": row.ending,
        "severity": row.severity,
        "delta-v [m/s]": _rounded_as_in_sentences(row.delta_v if row.severity else None),
        "hazards": ", ".join(name for name, _ in row.hazards),
        "margin": _rounded_as_in_sentences(row.margin),
        "first alert": row.alerts[0] if row.alerts else "",
        "fault": row.fault,
        "drive": f"{row.scenario_label}, {row.trigger}",
        "sentence": row.sentence,
    }


def _rounded_as_in_sentences(number: float | None) -> float | None:
    """Return a measured number with the digits that it has in sentences."""
    return None if number is None else float(measured_number_text(number))


def print_experiment(
    terminal: Terminal, experiment: "Experiment", patch: str, *, is_trial: bool = False
) -> None:
    """Print what was injected, and the diff. An experiment run by `try` has no method."""
    facts = experiment_facts(experiment) | {"method": "" if is_trial else experiment.method_text}
    facts = {name: value for name, value in facts.items() if value != ""}
    width = max(len(name) for name in facts)
    for name, value in facts.items():
        terminal.print_text(f"{name.ljust(width)}  {value}", style="bold" if name == "fault" else None)
    terminal.print_text()
    diff, note = patch_without_new_files(patch)
    terminal.print_diff(diff)
    terminal.print_text(note, style="dim")
    terminal.print_text()


def print_ending_in_words(terminal: Terminal, result: "ExperimentResult") -> None:
    """Print what came out, in words and in short: the ending, the first hazard, and whether an alert preceded
    it.
    """
    record = result.record
    if record is None:
        return
    terminal.print_text(result.sentence, style="bold")
    ending = _ending_of(record)
    parts = [ending]
    if record.hazards:
        name, t = min(record.hazards, key=lambda hazard: hazard[1])
        after = f", {t - record.activation.first:.2f} s after activation" if record.activation else ""
        parts[0] += f": {name} at {t:.2f} s{after}"
    manifest = _manifest_if_any(result)
    reaction_s = result.verdict["reaction_time_s"]
    if record.hazards and reaction_s is not None:
        parts.append(f"first alert {reaction_s:.2f} s before it")
    elif record.alerts and not record.hazards:
        parts.append(f"alert {record.alerts[0][0]} at {record.alerts[0][1]:.2f} s")
    elif manifest and (note := _missing_alert_note(record, manifest, reaction_s)):
        parts.append(note)
    terminal.print_text("; ".join(parts), style=STYLE_BY_ENDING.get(ending))
    terminal.print_text()


def _ending_of(record: "Record") -> str:
    return record.outcome.value if record.outcome else record.status.value


def print_verdict(terminal: Terminal, result: "ExperimentResult") -> None:
    """Print the verdict of an experiment that has run, its events, differences up to the end of the drive,
    and metrics.
    """
    record = result.record
    assert record is not None
    manifest = _manifest_if_any(result)
    ending = _ending_of(record)
    terminal.print_result(f"verdict: {ending}", style=STYLE_BY_ENDING.get(ending))
    if record.detail and record.outcome is None:  # the sentence says why a fault was never active
        terminal.print_text(record.detail)
    activation_s = record.activation.first if record.activation else None
    events = _list_events(record, manifest)
    if events:
        rows = [
            (f"{t:.2f}", "" if activation_s is None else f"{t - activation_s:+.2f}", label)
            # stable: of simultaneous events, causes precede effects
            for t, label in sorted(events, key=lambda e: e[0])
        ]
        terminal.print_table(["time [s]", "from activation [s]", "what"], rows, right_aligned=(0, 1))
    for line in _describe_defences(record, manifest):
        terminal.print_text(line)
    verdict = result.verdict
    if manifest and (note := _missing_alert_note(record, manifest, verdict["reaction_time_s"])):
        terminal.print_text(note)
    if verdict["severity"]:
        terminal.print_text(f"severity: {result.severity_label}, {result.severity_basis}")
    elif verdict["no_severity"]:
        terminal.print_text(f"no severity class: {verdict['no_severity']}")
    for name, what in _TIME_LABELS.items():
        if verdict[name] is not None:
            terminal.print_text(f"{what}: {verdict[name]:.2f} s")
    units = _unit_by_name(manifest) if manifest else {}
    deviations = _describe_values(verdict["difference_in_drive"].items(), units)
    if deviations:
        until = "" if record.t_end is None else " up to the end of the drive"
        terminal.print_text(f"largest difference from the golden run{until}: {deviations}")
    if record.metrics:
        terminal.print_text(f"metrics: {_describe_values(record.metrics, units)}")


def _manifest_if_any(result: "ExperimentResult") -> "TargetManifest | None":
    try:
        return result._manifest()
    except MutatorError:  # a run can be shown without its target
        return None


def _unit_by_name(manifest: "TargetManifest") -> dict[str, str]:
    channels = [(channel.name, channel.unit) for channel in manifest.compared_channels]
    pairs = channels + [(metric.name, metric.unit) for metric in manifest.all_metrics]
    return {name: unit for name, unit in pairs if unit not in ("", "-")}


def _describe_values(values: Iterable[tuple[str, float]], unit_by_name: Mapping[str, str]) -> str:
    texts = (f"{name} {value:.4g} {unit_by_name.get(name, '')}".rstrip() for name, value in values)
    # keep a value and its unit on one line
    return ", ".join(text.replace(" ", NO_BREAK_SPACE) for text in texts)


def _describe_defences(record: "Record", manifest: "TargetManifest | None") -> list[str]:
    """Return a line for each defence that acted; a line without one if there are defences in the tree."""
    if record.run_end is None:  # only runs with defences have one
        return []
    actuation = manifest.actuation if manifest else None
    units = (
        {command.name: command.unit for command in actuation.commands if command.unit != "-"}
        if actuation
        else {}
    )
    return [_describe_activity(activity, units) for activity in record.defences] or ["no defence acted"]


def _describe_activity(activity: "DefenceActivity", unit_by_command: Mapping[str, str]) -> str:
    """Return a line such as `defence aeb: first acted at 3.85 s, 1 activation, 40 steps; ...`."""
    values = _describe_values(((name, value) for name, _, value in activity.commands), unit_by_command)
    commanded = f"; furthest from 0, it commanded {values}" if values else ""
    return (
        f"defence {activity.name}: first acted at {activity.first:.2f} s, "
        f"{counted(activity.activations, 'activation')}, {counted(activity.steps, 'step')} "
        f"until {activity.last:.2f} s{commanded}"
    )


def _missing_alert_note(record: "Record", manifest: "TargetManifest", reaction_s: float | None) -> str:
    # no alert was possible, or nothing to warn of
    if not (manifest.alerts and record.outcome and record.activation):
        return ""
    if record.hazards:
        return "no alert before the hazard" if reaction_s is None else ""
    return "" if record.alerts else "no alert"


def print_fault_path(terminal: Terminal, experiment: StoredExperiment) -> None:
    if (path := experiment.fault_path) is None:
        return
    terminal.print_text("path of the fault:")
    for component in path.components:
        terminal.print_text(f"  {_describe_component(component)}")
    stopped = f", stopped at {' and '.join(path.stopped_at)}" if path.stopped_at else ""
    terminal.print_text(f"reached: {path.reached or 'no recorded component'}{stopped}")


def _describe_component(component: "PathComponent") -> str:
    """Return a line such as `brakes: reached at 3.50 s`; for an injected component, without a time."""
    state_text = f"{component.name}: {component.state.value}"
    if component.state.value == "injected":
        return state_text
    if component.t_changed_by is not None:
        return f"{state_text} by {component.t_changed_by:.2f} s"
    return state_text if component.t_first is None else f"{state_text} at {component.t_first:.2f} s"


def _list_events(record: "Record", manifest: "TargetManifest | None") -> list[tuple[float, str]]:
    meaning_by_hazard = {h.name: f": {h.about}" for h in manifest.hazard_rules if h.about} if manifest else {}
    events: list[tuple[float, str]] = []
    if record.activation:
        times = counted(record.activation.count, "time")
        events.append((record.activation.first, f"fault first active ({times} in the whole run)"))
        events.append((record.activation.last, "fault last active"))
    if record.t_manifest is not None:
        events.append((record.t_manifest, "manifested: an actuator differs from the golden run"))
    events += [(activity.first, f"defence {activity.name} first acts") for activity in record.defences]
    events += [(t, f"alert {name}") for name, t in record.alerts]
    events += [(t, f"hazard {name}{meaning_by_hazard.get(name, '')}") for name, t in record.hazards]
    if (end := record.t_end) is None:
        return events
    late_note = ", after the end of the drive"
    return [
        *((t, what + late_note * (t > end)) for t, what in events),
        (end, "end of the drive (metrics ignore later steps)"),
    ]


def print_trial(terminal: Terminal, trial: "Trial", *, with_plot: bool) -> None:
    """Print an experiment that `try` has just run. `with_plot`: write a plot next to its traces."""
    plot_path = _replace_plot(terminal, trial, with_plot=with_plot)
    command_progress_events.report_written_file("trial", trial.folder)
    if terminal.as_json:
        facts = {**experiment_facts(trial.experiment), **trial.verdict, "patch": trial.patch}
        facts |= {"sentence": trial.sentence}
        facts |= {"golden_hazards_s": dict(trial.golden_hazards)}
        terminal.print_json(
            facts | {"traces": str(trial.single.faulty), "plot": str(plot_path) if plot_path else None}
        )
        return
    print_experiment(terminal, trial.experiment, trial.patch, is_trial=True)
    terminal.print_text(trial.sentence, style="bold")
    print_verdict(terminal, trial)
    if trial.golden_hazards:
        reached = ", ".join(f"{name} at {t:.2f} s" for name, t in trial.golden_hazards)
        terminal.print_text(
            f"the fault-free run also reaches {reached}: the fault is not necessarily the cause"
        )
    if trial.log.strip() and trial.record.outcome is None:
        terminal.print_text("last lines of the run:")
        terminal.print_text(trial.log.strip(), without_folding=True)
    if plot_path:
        terminal.print_link("plot", plot_path, f"plot: {plot_path}")
    elif trial.has_trace:
        terminal.print_text(f"traces: {trial.folder} (--plot plots them)", without_folding=True)
    else:
        terminal.print_text("the run left no trace")


def _replace_plot(terminal: Terminal, trial: "Trial", *, with_plot: bool) -> Path | None:
    """Delete the plot of an earlier trial of the same experiment; write a new one if wanted."""
    path = trial.folder / "plot.svg"
    path.unlink(missing_ok=True)
    if not with_plot:
        return None
    with terminal.show_spinner("drawing"):
        return trial.save_plot(path)
