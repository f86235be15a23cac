"""An experiment to watch: its two runs driven again with a film, shown by the target's own command."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.files import ScratchFolder, make_folder
from mutator.engines import bytecode
from mutator.errors import MutatorError
from mutator.execution.single_run import rerun
from mutator.figures.run_plot import marks_of
from mutator.model import Record
from mutator.targets.manifest import FILM, TargetManifest
from mutator.targets.placeholders import filled
from mutator.workspace import Workspace

EVENTS_SCHEMA = "film-events/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A file that is wanted: a still picture of time `t` (s), or a video. Its name says the format."""

    out: Path
    t: float | None = None


def film_experiment(
    workspace: Workspace,
    manifest: TargetManifest,
    run: Path,
    experiment_id: str,
    title: str,
    shots: Sequence[Shot],
) -> bool:
    """Drive a planned experiment's golden and faulty run again and write `shots` of them.

    Says whether the new record equals the campaign's (true if there is none yet). MutatorError for a target
    that cannot be filmed, a faulty run that left no film, and with what the target's command complains of.
    """
    with ScratchFolder("mutator-film-") as folder:
        single, same = rerun(workspace, run, experiment_id, out=folder, film=True)
        if not (single.faulty / FILM).is_dir():
            raise MutatorError(
                f"the faulty run left no film: {single.record.status.value}, {single.record.detail}",
                remedy="choose an experiment that drives",
            )
        events = folder / "events.json"
        names = hazards_in_words(workspace, manifest)
        events.write_text(json.dumps(_events(single.record, title, names)), encoding="utf-8")
        places = {
            "golden": str(single.golden / FILM),
            "faulty": str(single.faulty / FILM),
            "events": str(events),
        }
        for shot in shots:
            _show(manifest, folder, places, shot)
    return same


def hazards_in_words(workspace: Workspace, manifest: TargetManifest) -> dict[str, str]:
    """Each hazard in a few words: as the manifest says how it is found; where that says nothing, as the
    hazard analysis does, up to the first bracket."""
    known = workspace.hazards()
    about = known.hazards if known else {}
    names = {name: words.partition(" (")[0].rstrip(".") for name, words in about.items()}
    return names | {rule.name: rule.about for rule in manifest.rules if rule.about}


def _events(record: Record, title: str, names: Mapping[str, str]) -> dict[str, object]:
    activation = record.activation
    return {
        "schema": EVENTS_SCHEMA,
        "title": title,
        "outcome": record.outcome.value if record.outcome else record.status.value,
        "active": [activation.first, activation.last] if activation else None,
        "marks": [{"kind": mark.kind.value, "t": mark.t, "label": mark.label} for mark in marks_of(record)],
        "names": names,
        "end": record.t_end,
    }


def _show(manifest: TargetManifest, folder: Path, places: Mapping[str, str], shot: Shot) -> None:
    """Have the target's command write one file; `folder` is for scratch."""
    film = manifest.film
    assert film is not None  # it has been taken
    tree = manifest.root
    if manifest.overlay is not None:
        tree = folder / "tree"
        bytecode.put(manifest.tree.files, tree)
    here = {**places, "out": str(shot.out.absolute()), "t": str(shot.t)}
    make_folder(shot.out.absolute().parent)
    arguments = (*film.args, *(film.still_args if shot.t is not None else ()))
    done = subprocess.run(
        [sys.executable, "-P", "-s", "-m", film.module, *filled(arguments, here)],
        env={**os.environ, **manifest.env, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or ["it said nothing"]
        raise MutatorError(said[-1].removeprefix("error: "), where=f"{film.module}")
