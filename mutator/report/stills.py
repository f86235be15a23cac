"""Which experiments get pictures as soon as a run is done: the worst few of those that see pictures."""

from collections.abc import Iterable
from itertools import islice

from mutator.model import Record, Status
from mutator.outcomes.ranking import worst
from mutator.outcomes.reader import Results
from mutator.report.film import Shot
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest

MOST, ONE_IN = 10, 20  # at most so many experiments, and one of so many that are planned
BUDGET_S = 120.0  # after which no other experiment is begun


def stills_due(folder: RunFolder, manifest: TargetManifest) -> dict[str, list[Shot]]:
    """The pictures that are not there yet, by experiment, the worst first: at the activation, the first alert
    and the first hazard of the worst experiments that see pictures."""
    if manifest.film is None or not manifest.film.pictures:
        return {}
    seeing = set(manifest.film.pictures)
    experiments = {e.id: e for e in plan_file.read_all(folder.path)}
    rows = (row for row in worst(Results.of_run(folder.path).rows()) if row.status is Status.OK)
    wanted = (
        row.experiment_id
        for row in rows
        if row.t_manifest is not None and seeing & set(experiments[row.experiment_id].changes)
    )
    records = folder.records()
    chosen = islice(wanted, min(MOST, folder.planned // ONE_IN))
    due = {name: _missing(folder, name, records[name]) for name in chosen}
    return {name: shots for name, shots in due.items() if shots}


def _missing(folder: RunFolder, experiment_id: str, record: Record) -> list[Shot]:
    names = {f"{experiment_id}-{t:.2f}s.jpg": t for t in _times(record)}
    shots = [Shot(out=folder.path / "plots" / name, t=t) for name, t in names.items()]
    return [shot for shot in shots if not shot.out.exists()]


def _times(record: Record) -> Iterable[float]:
    """When the fault became active, and when the first alert and the first hazard came."""
    if record.activation:
        yield record.activation.first
    for events in (record.alerts, record.hazards):
        yield from sorted(t for _, t in events)[:1]
