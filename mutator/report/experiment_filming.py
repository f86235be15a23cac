"""Films an experiment: reruns its golden and faulty runs with recording, and renders the film with the
target's command.
"""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import open_below, path_below
from mutator._common.files import ScratchFolder, make_folder, writing_temporary_path
from mutator.engines import pyc_files
from mutator.engines.in_target import process_guard
from mutator.engines.process_endings import environment_variables_of_run
from mutator.engines.run_limits import limits_before_measuring
from mutator.engines.sandbox import Sandbox
from mutator.errors import MutatorError
from mutator.execution.single_run import is_same_record, manifest_of_unchanged_target, run_golden, run_single
from mutator.figures.golden_and_faulty_plot import event_marks
from mutator.limits import Limits, MeasuredLimits
from mutator.model import Experiment, Record, Status
from mutator.store.run_folder import RunFolder
from mutator.targets.command_placeholders import fill_placeholders
from mutator.targets.manifest import FILM_FOLDER, TargetManifest
from mutator.workspace import Workspace

EVENTS_SCHEMA = "film-events/1"
_SCRIPT = Path(process_guard.__file__).with_name("run_module_in_turn.py")


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A still at time `t` (s) or a video to write."""

    path: Path  #: the file to write; its suffix selects the format
    t: float | None = None  #: the time of a still in s; None for a video


@dataclass(frozen=True, slots=True)
class ExperimentFilmer:
    """Films the experiments of a run."""

    workspace: Workspace
    folder: RunFolder
    target: TargetManifest

    @classmethod
    def of(cls, workspace: Workspace, folder: RunFolder) -> "ExperimentFilmer":
        """Prepare to film. Raise MutatorError if the target cannot be filmed or has changed since the
        run.
        """
        manifest = manifest_of_unchanged_target(workspace, folder)
        manifest.with_film_recording()  # raises the error
        return cls(workspace, folder, manifest)

    @property
    def _limits(self) -> Limits:
        """The limits of a filmed run, which takes longer than the runs for which limits were measured."""
        limits = self.folder.limits
        return limits_before_measuring(limits) if isinstance(limits, MeasuredLimits) else limits

    def rerun_golden(self, experiment: Experiment, out: Path, still_times: Iterable[float] = ()) -> Path:
        """Rerun an experiment's golden run into the folder `out`, with a film, or only with what stills at
        `still_times` need.
        """
        target = self.target.with_film_recording(still_times)
        return run_golden(self.workspace, target, experiment, out, limits=self._limits)

    def rerun_and_write_shots(
        self,
        experiment: Experiment,
        stored_record: Record | None,
        shots: Sequence[Shot],
        *,
        golden: Path | None = None,
    ) -> bool:
        """Rerun an experiment's faulty run, and the golden run unless it is given, and write `shots`.
        Return whether the new record equals `stored_record`; true without one. Raise MutatorError if the
        faulty run left no film or the target's command fails.
        """
        with ScratchFolder("mutator-film-") as scratch:
            single = run_single(
                self.workspace,
                self.target.with_film_recording(_still_times(shots, stored_record)),
                experiment,
                scratch,
                limits=self._limits,
                golden=golden,
            )
            record = single.record
            if not (single.faulty / FILM_FOLDER).is_dir():
                raise MutatorError(
                    f"the faulty run left no film: {record.status.value}, {record.detail}",
                    remedy="choose an experiment whose run finishes",
                )
            events = scratch / "events.json"
            names = describe_hazards(self.workspace, self.target)
            events.write_text(
                json.dumps(_film_events(record, _film_title(experiment), names)), encoding="utf-8"
            )
            film_paths = {
                "golden": str(single.golden / FILM_FOLDER),
                "faulty": str(single.faulty / FILM_FOLDER),
                "events": str(events),
            }
            _write_shots(self.target, scratch, film_paths, shots)
        return is_same_record(self.folder, stored_record, record)


def _still_times(shots: Sequence[Shot], record: Record | None) -> Sequence[float]:
    """Return the times of `shots`, or () if they need the whole film: for a video, and for a run that may
    crash before these times, whose last picture is then shown.
    """
    is_whole_run = record is not None and record.status is Status.OK
    times = [max(0.0, shot.t) for shot in shots if shot.t is not None]
    return times if is_whole_run and len(times) == len(shots) else ()


def describe_hazards(workspace: Workspace, manifest: TargetManifest) -> dict[str, str]:
    """Return a short text for each hazard, from the manifest or the hazard analysis (up to its first
    bracket).
    """
    analysis = workspace.hazards()
    about = analysis.hazards if analysis else {}
    names = {name: words.partition(" (")[0].rstrip(".") for name, words in about.items()}
    return names | {rule.name: rule.about for rule in manifest.hazard_rules if rule.about}


def _film_title(experiment: Experiment) -> str:
    trigger = f"{experiment.trigger.name}: {experiment.trigger.condition}".removesuffix(": True")
    return "   ".join(
        (experiment.fault.label, " ".join((experiment.scenario_label, *experiment.changes)), trigger)
    )


def _film_events(record: Record, title: str, names: Mapping[str, str]) -> dict[str, object]:
    activation = record.activation
    return {
        "schema": EVENTS_SCHEMA,
        "title": title,
        "outcome": record.outcome.value if record.outcome else record.status.value,
        "active": [activation.first, activation.last] if activation else None,
        "marks": [
            {"kind": mark.kind.value, "t": mark.t_s, "label": mark.label} for mark in event_marks(record)
        ],
        "names": names,
        "end": record.t_end,
    }


def _write_shots(
    manifest: TargetManifest, folder: Path, film_paths: Mapping[str, str], shots: Sequence[Shot]
) -> None:
    """Write files with the target's command, all in one process."""
    film = manifest.film
    assert film is not None  # callers checked this
    tree = manifest.root
    if manifest.overlay is not None:
        tree = folder / "tree"
        pyc_files.replace_dropping_bytecode(manifest.tree.files, tree)
    scratch_folder, argument_lists = folder / "shown", []
    make_folder(scratch_folder)
    scratch_files = [path_below(scratch_folder, f"{n}{shot.path.suffix}") for n, shot in enumerate(shots)]
    for shot, scratch_file in zip(shots, scratch_files, strict=True):
        make_folder(shot.path.absolute().parent)
        arguments = (*film.args, *(film.still_args if shot.t is not None else ()))
        placeholders = {**film_paths, "out": str(scratch_file), "t": str(shot.t)}
        argument_lists.append(list(fill_placeholders(arguments, placeholders)))
    # -P and -s: neither the current folder nor the user's packages can replace a module of the target
    script = (str(_SCRIPT), film.module, json.dumps(argument_lists))
    command = [sys.executable, "-P", "-s", *script]
    films = (Path(film_paths["golden"]), Path(film_paths["faulty"]))
    if sandbox := Sandbox.of_target(manifest, folder, [*films, tree]):
        command = sandbox.wrap_command(command)
        sandbox.close()
    process = subprocess.run(
        command,
        cwd=scratch_folder,
        env={**environment_variables_of_run(0, folder, manifest.env), "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        check=False,
    )
    for shot, scratch_file in zip(shots, scratch_files, strict=True):
        if not scratch_file.is_file() or (process.returncode and shot is shots[-1]):
            error_lines = process.stderr.strip().splitlines() or ["no message"]
            complaint = error_lines[-1].removeprefix("error: ")
            complaint = complaint.replace(str(scratch_file), str(shot.path.absolute()))
            raise MutatorError(complaint, where=f"{film.module}")
        _copy_plain_file(scratch_file, shot.path.absolute())


def _copy_plain_file(source_path: Path, out: Path) -> None:
    # copying can be interrupted, and the command can leave a link
    with (
        open_below(source_path.parent, source_path.name) as source,
        writing_temporary_path(out) as half,
        half.open("wb") as target,
    ):
        shutil.copyfileobj(source, target)
