"""Reports and comparisons of the served runs, rebuilt when outdated."""

import os
import threading
from pathlib import Path

from starlette.responses import HTMLResponse, Response

from mutator._common.hashing import digest
from mutator.comparison import comparison as comparing
from mutator.comparison import pages
from mutator.errors import MutatorError
from mutator.outcomes.fault_free import fault_free_runs, own_alerts
from mutator.outcomes.reader import Results
from mutator.report import building
from mutator.serve.answers import OpenFile, kind_of
from mutator.serve.runs import REPORT, Absent, Runs, check_no_links, open_in_run
from mutator.store.run_folder import RunFolder
from mutator.store.series_script import read_script, script_of
from mutator.workspace import Workspace

_STUDY = "report/study.html"
_STYLES = b'<link rel="stylesheet" href="/assets/served.css">\n</head>'
_SCRIPT = b"""<script src="/assets/jobs.js" defer></script>
<script src="/assets/served.js" defer></script>
</body>"""
_MOST_COMPARED = 4  # cached comparisons


class Shown:
    """Serves files of the runs, and pages made from them. Only one page is made at a time."""

    def __init__(self, workspace: Workspace, runs: Runs) -> None:
        self._workspace, self._runs = workspace, runs
        self._making = threading.Lock()
        self._compared: dict[tuple[str, str], dict[str, bytes]] = {}

    def file(self, key: str, name: str) -> Response:
        """Open a file of a run; Absent if it is not served."""
        run = self._runs.folder(key)
        if name in (REPORT, _STUDY):
            return self._page(run, name)
        if name.endswith(".js"):
            return Response(_series(run, name), media_type=kind_of(name))
        return OpenFile(open_in_run(run, name), name)

    def comparison(self, a: str, b: str, name: str) -> Response:
        """Open a file of a comparison of two runs; MutatorError if they cannot be compared."""
        folders = [self._runs.folder(key) for key in (a, b)]
        with self._making:
            first, second = (digest(Results.up_to_date(folder).csv()) for folder in folders)
            made = self._compared.pop((first, second), None) or self._comparison(*folders)
            self._compared[first, second] = made
            for old in list(self._compared)[:-_MOST_COMPARED]:
                del self._compared[old]
        if name not in made:
            raise Absent("no such file", expected=f"one of {', '.join(made)}")
        return Response(made[name], media_type=kind_of(name))

    def _page(self, run: Path, name: str) -> Response:
        check_no_links(run)
        with self._making:
            building.ensure(run, self._workspace)
        data = _read(open_in_run(run, name))
        if name == REPORT:
            data = _STYLES.join(data.split(b"</head>", 1))
            data = _SCRIPT.join(data.rsplit(b"</body>", 1))
        return HTMLResponse(data)

    def _comparison(self, a: Path, b: Path) -> dict[str, bytes]:
        made = comparing.compare(a, b, None, (self._alerts(a), self._alerts(b)))
        return {
            "index.html": pages.page(made).encode(),
            "pairs.csv": pages.pairs_csv(made),
            "unmatched.csv": pages.unmatched_csv(made),
        }

    def _alerts(self, run: Path) -> str:
        folder = RunFolder.open(run)
        try:
            return own_alerts(fault_free_runs(folder, self._workspace.manifest(folder.head["target"])))
        except (MutatorError, KeyError):
            return ""


def _series(run: Path, name: str) -> bytes:
    """Read a script of series; Absent unless it equals the output of `write_script` for the same data."""
    data = _read(open_in_run(run, name))
    path = run / name
    try:
        if script_of(path.stem, read_script(path)) == data:
            return data
    except MutatorError:
        pass
    raise Absent("no such file", expected="series as a run writes them")


def _read(descriptor: int) -> bytes:
    with os.fdopen(descriptor, "rb") as file:
        return file.read()
