"""Reports that the server builds from runs, in memory and in the cache of all commands.

The server never sends a page that is stored in a run folder, because whoever made the folder could have
written it.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress

from mutator._common import cache_layout_and_pruning
from mutator._common.confined_files import read_below, write_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import digest
from mutator.errors import MutatorError

PAGES_SCHEMA = "pages/1"
DIGESTS_FILE = "files.json"
_MOST_IN_MEMORY = 2  # a report can have 15 MB


class ReportCache:
    """The files of reports, by the digest of their inputs (`report_digests.inputs_digest`) and by name."""

    def __init__(self) -> None:
        self._memory: dict[str, Mapping[str, bytes]] = {}

    def cached_or_built_file(
        self, inputs_digest: str, name: str, build: Callable[[], Mapping[str, bytes]]
    ) -> bytes | None:
        """Return a file of a report, or None if it has no such file. `build` builds a report that is not
        cached.
        """
        files = self._memory.pop(inputs_digest, None) or _read_cached(inputs_digest)
        if files is None:
            files = build()
            with suppress(OSError, MutatorError):  # the cache cannot be written
                _write_cached(inputs_digest, files)
        self._memory[inputs_digest] = files
        for old in list(self._memory)[:-_MOST_IN_MEMORY]:
            del self._memory[old]
        return files.get(name)


def _read_cached(key: str) -> Mapping[str, bytes] | None:
    """Read a report from the cache; None if it is missing or damaged."""
    folder = cache_layout_and_pruning.cached_reports_folder() / key
    try:
        stored = parse_json_object(read_below(folder, DIGESTS_FILE), folder / DIGESTS_FILE, PAGES_SCHEMA)
        digests = stored["files"]
        files = {name: read_below(folder, name) for name in digests}
    except (OSError, MutatorError, LookupError, TypeError):
        return None
    return files if {name: digest(data) for name, data in files.items()} == digests else None


def _write_cached(key: str, files: Mapping[str, bytes]) -> None:
    folder = cache_layout_and_pruning.cached_reports_folder() / key
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        write_below(folder, name, data)
    digests = {name: digest(data) for name, data in files.items()}
    write_below(
        folder, DIGESTS_FILE, json_bytes({"schema": PAGES_SCHEMA, "files": digests})
    )  # last: marks it as complete
    cache_layout_and_pruning.prune_cached_reports()
