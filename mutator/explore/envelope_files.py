"""`envelopes.json`: the envelopes of a finished exploration, which follow from its plan and records."""

import json
from collections.abc import Iterator
from pathlib import Path

from mutator._common.confined_files import path_below, read_below, unlink_below, write_below
from mutator.errors import MutatorError
from mutator.explore.exploration_replay import ExplorationReplay

ENVELOPES_FILE, ENVELOPES_SCHEMA = "envelopes.json", "envelopes/1"


def write_envelopes(run: Path, replay: ExplorationReplay) -> None:
    """Write the file into the run folder `run`. MutatorError if the plan does not follow from the records."""
    for difference in replay.differences:
        raise difference
    write_below(run, ENVELOPES_FILE, _file_bytes(replay))


def delete_envelopes(run: Path) -> None:
    """Delete the file, before the runs go on that it would not contain."""
    unlink_below(run, ENVELOPES_FILE)


def envelope_file_problems(run: Path, replay: ExplorationReplay) -> Iterator[MutatorError]:
    """Yield a problem if the file differs from what follows from the records. It may be missing."""
    path = path_below(run, ENVELOPES_FILE)
    if not path.exists() or replay.differences:  # then nothing follows
        return
    if read_below(run, ENVELOPES_FILE) != _file_bytes(replay):
        yield MutatorError(
            "does not follow from the records",
            where=path,
            expected="what `mutator envelope` wrote",
            remedy="delete it, and run the same `mutator envelope` again: it writes the file",
        )


def _file_bytes(replay: ExplorationReplay) -> bytes:
    head = {"schema": ENVELOPES_SCHEMA, "unfinished_planes": replay.unfinished_count}
    planes = ",\n".join(json.dumps(envelope.as_json()) for envelope in replay.envelopes)
    return f'{json.dumps(head)[:-1]}, "planes": [\n{planes}\n]}}\n'.encode()
