"""Pages of the server's own that show what has just run: a run that a command works on, one of its
experiments, a trial. The server sends their data as JSON, and their scripts show all of it as text.
"""

from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response

from mutator._common.folder_locks import is_owner_alive
from mutator.errors import MutatorError, NotServed
from mutator.report.lone_experiment_data import ViewedTarget, experiment_view_data
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.serve.home_live_trial_and_error_pages import live_page, trial_page
from mutator.serve.job_queue import ServeJob, ServeJobs
from mutator.serve.page_tokens import TRIAL_PAGE, PageTokens, live_page_name
from mutator.serve.run_states import FAILED, FINISHED, RUNNING, state_of_run
from mutator.serve.served_runs import ServedRuns, live_address, report_address
from mutator.serve.served_trials import TRIALS_FOLDER, ServedTrials
from mutator.serve.watched_runs import WatchedRuns, state_as_json
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import unpacked_series
from mutator.workspace import Workspace

_STATE_WHILE_PLANNING = {"state": RUNNING, "stage": "plan", "rows": [], "version": 0, "planned": 0, "done": 0}


def _is_pass_of_watch(run: Path) -> bool:
    """Whether `mutator watch` is at work, which puts another run in this place after the next edit."""
    return is_owner_alive(run.parent)


class WatchPages:
    def __init__(self, workspace: Workspace, runs: ServedRuns, jobs: ServeJobs, tokens: PageTokens) -> None:
        self._workspace, self._runs, self._jobs, self._tokens = workspace, runs, jobs, tokens
        self._watched = WatchedRuns()
        self._trials = ServedTrials(workspace)

    def live_html(self, request: Request) -> Response:
        """Send the page that watches a run; a run that is finished, and followed by no other, has its report
        instead.
        """
        key = request.path_params["run"]
        path = self._runs.folders_by_key().get(key)
        is_over = path is not None and state_of_run(RunFolder.open_unverified(path)).state == FINISHED
        if path is not None and is_over and not _is_pass_of_watch(path):
            return RedirectResponse(report_address(key))
        if path is None and (path := self._folder_before_plan(key)) is None:
            self._runs.folder(key)  # raises NotServed
        assert path is not None
        return HTMLResponse(live_page(key, self._tokens.token_of(live_page_name(path))))

    def live_data(self, request: Request) -> Response:
        """Send state, counts and, unless the page has seen this version of them, the worst results so far."""
        key, seen_version = (
            request.path_params["run"],
            _parse_whole_number(request.query_params.get("version", "0")),
        )
        job = self._job_of(key)
        facts: dict[str, Any] = {"job": job.as_json() if job else None, "report": None}
        path = self._runs.folders_by_key().get(key)
        if path is None:
            return JSONResponse(facts | self._state_before_plan(key, job))
        folder = RunFolder.open_unverified(path)
        run_state = state_of_run(folder)  # first: what follows is at least as new
        if run_state.state == FINISHED:
            facts["report"] = report_address(key)
        facts |= state_as_json(run_state) | self._watched.poll(folder, seen_version)
        facts |= {"campaign": folder.head.campaign, "target": folder.head.target}
        facts["is_followed"] = _is_pass_of_watch(path)
        return JSONResponse(facts)

    def live_experiment_html(self, request: Request) -> Response:
        key, name = request.path_params["run"], request.path_params["experiment"]
        self._listed_experiment(RunFolder.open_unverified(self._runs.folder(key)), name)
        address = f"/api/runs/{quote(key, safe='')}/experiments/{quote(name, safe='')}"
        return HTMLResponse(trial_page(address, live_address(key), key, token=""))

    def live_experiment_data(self, request: Request) -> Response:
        """Send the view of one of the worst experiments of a run so far."""
        key, name = request.path_params["run"], request.path_params["experiment"]
        folder = RunFolder.open_unverified(self._runs.folder(key))
        finished = self._listed_experiment(folder, name)
        patch = folder.patches.read_patch(name) if finished.record.patch else None
        series = unpacked_series(folder.path, name)
        reason = "The channels of this experiment can be read when the run is finished."
        target = ViewedTarget.of_run(folder, self._manifest(folder.head.target))
        facts = {"finished": folder.is_finished, "report": f"{report_address(key)}#e={name}"}
        return JSONResponse(facts | experiment_view_data(target, finished, patch, series, reason))

    def _listed_experiment(self, folder: RunFolder, name: str) -> FinishedExperiment:
        """Return one of the worst experiments of a run so far; NotServed if it is not among them."""
        finished = self._watched.listed_experiment(folder, name)
        if finished is None:
            raise NotServed(
                f"no experiment '{name}' among the worst so far",
                expected="an id in the list",
                remedy="wait for the report",
            )
        return finished

    def trial_html(self, request: Request) -> Response:
        name = request.path_params["trial"]
        self._trials.folder(self._trials_folder, name)
        address = f"/api/trials/{quote(name, safe='')}"
        return HTMLResponse(
            trial_page(address, "/", "Runs and reviews", token=self._tokens.token_of(TRIAL_PAGE))
        )

    def trial_data(self, request: Request) -> Response:
        return JSONResponse(self._trials.view_data(self._trials_folder, request.path_params["trial"]))

    @property
    def _trials_folder(self) -> Path:
        return self._runs.folder_for_new_runs / TRIALS_FOLDER

    def _manifest(self, name: str) -> Any:
        try:
            return self._workspace.manifest(name)
        except (MutatorError, KeyError):
            return None

    def _job_of(self, key: str) -> ServeJob | None:
        """Return the newest job of this server that runs the campaign of a run."""
        return next(
            (
                job
                for job in self._jobs.all()
                if job.job_command.job_request.kind == "campaign"
                and job.job_command.run_folder is not None
                and self._runs.reserved_key(job.job_command.run_folder) == key
            ),
            None,
        )

    def _folder_before_plan(self, key: str) -> Path | None:
        """Return the folder of a run that has no plan yet: that of a job, or one in which a command plans."""
        job = self._job_of(key)
        return job.job_command.run_folder if job else self._runs.unplanned_folder(key)

    def _state_before_plan(self, key: str, job: ServeJob | None) -> dict[str, Any]:
        if job is None:
            if self._runs.unplanned_folder(key) is None:
                self._runs.folder(key)  # raises NotServed
            return _STATE_WHILE_PLANNING
        if job.ended:
            return _STATE_WHILE_PLANNING | {"state": FAILED, "problem": job.message}
        return _STATE_WHILE_PLANNING | {"detail": "waits for other jobs" if job.state == "queued" else ""}


def _parse_whole_number(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 16):
        raise MutatorError(f"version '{text}'", expected="a whole number")
    return int(text)
