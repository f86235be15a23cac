"""Reports and comparisons, which the server builds from the data of the served runs, and files of runs."""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from starlette.responses import HTMLResponse, Response

from mutator._common.bounded_reading import read_open_file
from mutator._common.confined_files import check_only_plain_files
from mutator._common.hashing import as_json_types, digest
from mutator.audit.table_audit import audit_tables
from mutator.comparison import comparison_files
from mutator.comparison import run_comparison_and_gates as comparing
from mutator.comparison.comparison_replays import ReportAddresses
from mutator.errors import MutatorError, NotServed
from mutator.explore.envelope import Envelope
from mutator.explore.exploration_replay import is_exploration, replay_exploration
from mutator.outcomes.fault_free_runs import fault_free_alerts_note, load_fault_free_runs
from mutator.report import report_builder
from mutator.report.change_since_run_before import ChangeSinceRunBefore, find_change
from mutator.report.panel import REPORT_FOLDER
from mutator.report.random_searches import RandomSearches, stored_random_searches
from mutator.report.report_digests import inputs_digest
from mutator.results.table_reader import Results
from mutator.serve.http_responses import UNTRUSTED_FILE_HEADERS, OpenFileResponse, media_type_of
from mutator.serve.page_tokens import PageTokens, run_page_name
from mutator.serve.report_cache import ReportCache
from mutator.serve.served_runs import ServedRuns, open_served_file, report_address
from mutator.store.run_folder import RunFolder
from mutator.store.series_script import read_script, script_bytes
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.targets.overhead_view_json import scene_as_json
from mutator.web import load_order
from mutator.workspace import Workspace

_STYLE_LINKS = [f'<link rel="stylesheet" href="/assets/{name}">' for name in load_order("serve", ".css")]
_ADDED_HEAD_END = "\n".join(['<meta name="mutator-page" content="{}">', *_STYLE_LINKS, "</head>"])
_ADDED_BODY_END = "\n".join(
    [*(f'<script src="/assets/{name}" defer></script>' for name in load_order("serve", ".js")), "</body>"]
).encode()
_MOST_CACHED_COMPARISONS = 4  # cached comparisons


class RunPages:
    """Serves files of the runs, and pages made from them. Only one page is made at a time."""

    def __init__(self, workspace: Workspace, runs: ServedRuns, tokens: PageTokens) -> None:
        self._workspace, self._runs, self._tokens = workspace, runs, tokens
        self._reports = ReportCache()
        self._page_lock = threading.Lock()
        self._comparison_cache: dict[tuple[str, str], dict[str, bytes]] = {}

    def run_file(self, key: str, name: str) -> Response:
        """Open a file of a run, or a part of its report; NotServed if it is not served."""
        run = self._runs.folder(key)
        if name.startswith(f"{REPORT_FOLDER}/"):
            return self._report_file(run, name.removeprefix(f"{REPORT_FOLDER}/"))
        if name.endswith(".js"):
            return Response(
                _read_series_script(run, name), media_type=media_type_of(name), headers=UNTRUSTED_FILE_HEADERS
            )
        return OpenFileResponse(open_served_file(run, name), name)

    def comparison_file(self, a: str, b: str, name: str) -> Response:
        """Open a file of a comparison of two runs; MutatorError if they cannot be compared."""
        folders = [self._runs.folder(key) for key in (a, b)]
        for folder in folders:
            check_only_plain_files(folder)  # because outdated tables are written
        with self._page_lock:
            first, second = map(_comparison_inputs, (a, b), folders)
            addresses = ReportAddresses(a=report_address(a), b=report_address(b))
            files = self._comparison_cache.pop((first, second), None) or self._build_comparison_files(
                folders[0], folders[1], addresses
            )
            self._comparison_cache[first, second] = files
            for old in list(self._comparison_cache)[:-_MOST_CACHED_COMPARISONS]:
                del self._comparison_cache[old]
        if name not in files:
            raise NotServed("no such file", expected=f"one of {', '.join(files)}")
        return Response(files[name], media_type=media_type_of(name))

    def _report_file(self, run: Path, name: str) -> Response:
        """Build the report if it is not cached, whatever report the run folder contains."""
        folder = RunFolder.open(run)
        with self._page_lock:
            change = find_change(folder, Results(run).frame())
            beside = stored_random_searches(folder)  # not sought, which replays other runs
            key = digest([inputs_digest(folder, self._workspace), as_json_types([change, beside])])
            data = self._reports.cached_or_built_file(
                key, name, lambda: self._build_report_files(folder, change, beside)
            )
        if data is None:
            raise NotServed("no such file", expected="a file of the report")
        if not name.endswith(".html"):
            return Response(data, media_type=media_type_of(name), headers=UNTRUSTED_FILE_HEADERS)
        if name == report_builder.PAGE_FILE:
            head = _ADDED_HEAD_END.format(self._tokens.token_of(run_page_name(run))).encode()
            data = head.join(data.split(b"</head>", 1))
            data = _ADDED_BODY_END.join(data.rsplit(b"</body>", 1))
        return HTMLResponse(data)

    def _build_report_files(
        self, folder: RunFolder, change: ChangeSinceRunBefore | None, beside: RandomSearches
    ) -> Mapping[str, bytes]:
        """Build a report. Raise MutatorError if the tables of a finished run do not follow from its records:
        the report shows them beside the run's seal.
        """
        if folder.is_finished:
            for problem in audit_tables(folder)[1]:
                raise problem
        return report_builder.build_report(
            folder, self._workspace, change=change, random_searches=beside
        ).files

    def _build_comparison_files(self, a: Path, b: Path, addresses: ReportAddresses) -> dict[str, bytes]:
        notes = (self._golden_alerts_note(a), self._golden_alerts_note(b))
        scenes, envelopes = (self._scene(a), self._scene(b)), (self._envelopes(a), self._envelopes(b))
        comparison = comparing.compare_runs(a, b, None, notes, scenes, envelopes)
        return {
            "index.html": comparison_files.render_html_page(comparison, addresses).encode(),
            "pairs.csv": comparison_files.pairs_csv(comparison),
            "unmatched.csv": comparison_files.unmatched_csv(comparison),
        }

    def _envelopes(self, run: Path) -> list[Envelope]:
        """Return the envelopes of an exploration; none without a library that has its target."""
        folder = RunFolder.open(run)
        try:
            if not is_exploration(folder):
                return []
            replay = replay_exploration(folder, self._workspace.manifest(folder.head.target))
        except (MutatorError, KeyError):
            return []
        for difference in replay.differences:
            raise difference
        return replay.envelopes

    def _scene(self, run: Path) -> dict[str, Any] | None:
        try:
            return scene_as_json(self._workspace.manifest_of(RunFolder.open(run).head))
        except (MutatorError, KeyError):
            return None

    def _golden_alerts_note(self, run: Path) -> str:
        folder = RunFolder.open(run)
        try:
            return fault_free_alerts_note(
                load_fault_free_runs(folder, self._workspace.manifest_of(folder.head))
            )
        except (MutatorError, KeyError):
            return ""


def _comparison_inputs(key: str, run: Path) -> str:
    """Return the digest of what a comparison's page shows of a run: its address, results and series."""
    return digest([key, digest(Results.up_to_date(run).parquet()), TimeSeriesFolder(run).rerun_ids()])


def _read_series_script(run: Path, name: str) -> bytes:
    """Read a script of series; NotServed unless it equals the output of `script_bytes` for the same data."""
    path = run / name
    with open_served_file(run, name) as file:
        data = read_open_file(file, path)
    try:
        if script_bytes(path.stem, read_script(path)) == data:
            return data
    except MutatorError:
        pass
    raise NotServed("no such file", expected="series as a run writes them")
