"""The application, with its routes."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from mutator.errors import MutatorError, NotServed
from mutator.serve.home_live_trial_and_error_pages import form_choices, home_page
from mutator.serve.http_responses import error_response, media_type_of
from mutator.serve.job_queue import ServeJobs
from mutator.serve.job_requests import RequestChecker
from mutator.serve.json_api import JobApi, ReviewApi, selected_groups
from mutator.serve.live_and_trial_pages import WatchPages
from mutator.serve.page_tokens import HOME_PAGE, PageTokens, review_page_name
from mutator.serve.report_and_comparison_pages import RunPages
from mutator.serve.run_states import can_make_report
from mutator.serve.served_reviews import ServedReviews
from mutator.serve.served_runs import REPORT_PAGE, ServedRuns, live_address, report_address, summarize_run
from mutator.web import asset_names, asset_text
from mutator.workspace import Workspace

AsyncHandler = Callable[[Request], Awaitable[Response]]


@dataclass(kw_only=True)
class ServedSite:
    """The content of the server: a library, runs, and jobs (at most `most_jobs_at_once` at a time)."""

    workspace: Workspace
    runs: ServedRuns
    most_jobs_at_once: int = 1
    tokens: PageTokens = field(default_factory=PageTokens)
    run_pages: RunPages = field(init=False)
    reviews: ServedReviews = field(init=False)
    jobs: ServeJobs = field(init=False)

    def __post_init__(self) -> None:
        self.run_pages = RunPages(self.workspace, self.runs, self.tokens)
        self.reviews = ServedReviews(self.workspace)
        self.jobs = ServeJobs(self.most_jobs_at_once, self._report_address)

    def summarize_runs(self) -> list[dict[str, Any]]:
        """Return all runs, the one that was worked on last first."""
        runs = [summarize_run(key, path) for key, path in self.runs.folders_by_key().items()]
        return sorted(runs, key=lambda run: run["changed"], reverse=True)

    def _report_address(self, run: Path) -> str | None:
        key = self.runs.key_of(run)
        return report_address(key) if key else None


def build_application(site: ServedSite) -> Starlette:
    """Return the application without the checks of `security`; its shutdown ends the jobs."""

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(site.jobs.close)

    reviews = ReviewApi(site.reviews, site.runs, site.tokens)
    jobs = JobApi(RequestChecker(site.workspace, site.runs), site.jobs, site.tokens)
    routes = [
        *_page_routes(site),
        Route("/api/library", _answered_in_thread(lambda _: JSONResponse(form_choices(site.workspace)))),
        Route("/api/runs", _answered_in_thread(lambda _: JSONResponse({"runs": site.summarize_runs()}))),
        Route("/api/review/{target}", _answered_in_thread(reviews.group_reviews)),
        Route("/api/review/{target}", _json_post_handler(reviews.decide), methods=["POST"]),
        Route("/api/review/{target}/{group}/changes", _answered_in_thread(reviews.changes_since_decision)),
        Route("/api/review/{target}/{group}/pictures", _answered_in_thread(reviews.picture_levels)),
        Route("/api/review/{target}/{group}/typical", _answered_in_thread(reviews.typical_results)),
        Route(
            "/review/{target}/{group}/picture/{level}-before.jpg", _answered_in_thread(reviews.picture_before)
        ),
        Route(
            "/review/{target}/{group}/picture/{level}-after.jpg", _answered_in_thread(reviews.picture_after)
        ),
        Route("/api/jobs", _answered_in_thread(jobs.list_jobs)),
        Route("/api/jobs", _json_post_handler(jobs.submit), methods=["POST"]),
        Route("/api/jobs/{job}/log", _answered_in_thread(jobs.log)),
        Route("/api/jobs/{job}/cancel", _json_post_handler(jobs.cancel), methods=["POST"]),
    ]
    errors: dict[Any, Any] = dict.fromkeys((MutatorError, ValidationError, HTTPException), error_response)
    return Starlette(routes=routes, exception_handlers=errors, lifespan=lifespan)


def _answered_in_thread(answer: Callable[[Request], Response]) -> AsyncHandler:
    """Compute the response in a thread, so that other requests need not wait."""

    async def handler(request: Request) -> Response:
        return await run_in_threadpool(answer, request)

    return handler


def _json_post_handler(answer: Callable[[Request, bytes], Response]) -> AsyncHandler:
    async def handler(request: Request) -> Response:
        content_type = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if content_type != "application/json":
            raise HTTPException(415, "the content type is not application/json")
        return await run_in_threadpool(answer, request, await request.body())

    return handler


def _page_routes(site: ServedSite) -> list[Route]:
    watching = WatchPages(site.workspace, site.runs, site.jobs, site.tokens)

    def home(_: Request) -> Response:
        return HTMLResponse(home_page(site.workspace, site.summarize_runs(), site.tokens.token_of(HOME_PAGE)))

    def redirect_to_report(request: Request) -> Response:
        return RedirectResponse(report_address(request.path_params["run"]))

    def run_file(request: Request) -> Response:
        key, name = request.path_params["run"], request.path_params["path"]
        if name == REPORT_PAGE and not can_make_report(site.runs.folder(key)):
            return RedirectResponse(live_address(key))
        return site.run_pages.run_file(key, name)

    def comparison_file(request: Request) -> Response:
        parameters = request.path_params
        return site.run_pages.comparison_file(
            parameters["a"], parameters["b"], parameters.get("name") or "index.html"
        )

    def review_html(request: Request) -> Response:
        selection = selected_groups(site.reviews, request)
        runs_of_target = [run for run in site.summarize_runs() if run["target"] == selection.target]
        runs = [{"key": run["key"], "name": run["key"]} for run in runs_of_target]
        token = site.tokens.token_of(review_page_name(selection.target))
        return HTMLResponse(site.reviews.render_html_page(selection, request.url.query, runs, token))

    return [
        Route("/", _answered_in_thread(home)),
        Route("/assets/{name:path}", _answered_in_thread(_asset_response)),
        Route("/runs/{run}/", _answered_in_thread(redirect_to_report)),
        Route("/runs/{run}/{path:path}", _answered_in_thread(run_file)),
        Route("/compare/{a}/{b}/", _answered_in_thread(comparison_file)),
        Route("/compare/{a}/{b}/{name}", _answered_in_thread(comparison_file)),
        Route("/live/{run}", _answered_in_thread(watching.live_html)),
        Route("/live/{run}/{experiment}", _answered_in_thread(watching.live_experiment_html)),
        Route("/trial/{trial}", _answered_in_thread(watching.trial_html)),
        Route("/api/runs/{run}/live", _answered_in_thread(watching.live_data)),
        Route("/api/runs/{run}/experiments/{experiment}", _answered_in_thread(watching.live_experiment_data)),
        Route("/api/trials/{trial}", _answered_in_thread(watching.trial_data)),
        Route("/review/{target}", _answered_in_thread(review_html)),
    ]


def _asset_response(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in (*asset_names(".js"), *asset_names(".css")):
        raise NotServed("no such file")
    return Response(asset_text(name), media_type=media_type_of(name))
