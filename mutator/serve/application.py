"""The application, with its routes."""

import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from typing import Any

from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from mutator.errors import MutatorError, NotServed
from mutator.serve.home import home_page, offered
from mutator.serve.job_requests import TRIES, Desk, Work
from mutator.serve.jobs import Jobs
from mutator.serve.json_api import JobApi, ReviewApi, asked
from mutator.serve.page_tokens import HOME, PageTokens, review_page
from mutator.serve.report_pages import Shown
from mutator.serve.responses import OpenFile, kind_of, on_error
from mutator.serve.served_reviews import Reviews
from mutator.serve.served_runs import Runs, open_file, report_of, told
from mutator.web import asset_names, asset_text
from mutator.workspace import Workspace

_PLOT = "plot.svg"
Answer = Callable[[Request], Awaitable[Response]]


@dataclass(kw_only=True)
class Site:
    """The content of the server: a library, runs, and jobs (at most `at_once` at a time)."""

    workspace: Workspace
    runs: Runs
    at_once: int = 1
    tokens: PageTokens = field(default_factory=PageTokens)
    shown: Shown = field(init=False)
    reviews: Reviews = field(init=False)
    jobs: Jobs = field(init=False)

    def __post_init__(self) -> None:
        self.shown = Shown(self.workspace, self.runs, self.tokens)
        self.reviews = Reviews(self.workspace)
        self.jobs = Jobs(self.at_once, self._report_at)

    def told_runs(self) -> list[dict[str, Any]]:
        return [told(key, path) for key, path in self.runs.folders().items()]

    def _report_at(self, work: Work) -> str | None:
        key = self.runs.key_of(work.folder) if work.folder else None
        return report_of(key) if key else None


def build_application(site: Site) -> Starlette:
    """Return the application without the checks of `security`; its shutdown ends the jobs."""

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        yield
        await run_in_threadpool(site.jobs.close)

    reviews = ReviewApi(site.reviews, site.runs, site.tokens)
    jobs = JobApi(Desk(site.workspace, site.runs), site.jobs, site.tokens)
    routes = [
        *_pages(site),
        Route("/api/library", _quick(lambda _: JSONResponse(offered(site.workspace)))),
        Route("/api/runs", _quick(lambda _: JSONResponse({"runs": site.told_runs()}))),
        Route("/api/review/{target}", _quick(reviews.told)),
        Route("/api/review/{target}", _sent(reviews.decide), methods=["POST"]),
        Route("/api/review/{target}/{group}/changes", _quick(reviews.changes)),
        Route("/api/review/{target}/{group}/pictures", _quick(reviews.levels)),
        Route("/api/review/{target}/{group}/typical", _quick(reviews.typical)),
        Route("/review/{target}/{group}/picture/{level}-before.jpg", _quick(reviews.before)),
        Route("/review/{target}/{group}/picture/{level}-after.jpg", _quick(reviews.after)),
        Route("/api/jobs", _quick(jobs.told)),
        Route("/api/jobs", _sent(jobs.submit), methods=["POST"]),
        Route("/api/jobs/{job}/log", _quick(jobs.log)),
        Route("/api/jobs/{job}/cancel", _sent(jobs.cancel), methods=["POST"]),
    ]
    errors: dict[Any, Any] = dict.fromkeys((MutatorError, ValidationError, HTTPException), on_error)
    return Starlette(routes=routes, exception_handlers=errors, lifespan=lifespan)


def _quick(answer: Callable[[Request], Response]) -> Answer:
    """Compute the response in a thread, so that other requests need not wait."""

    async def answered(request: Request) -> Response:
        return await run_in_threadpool(answer, request)

    return answered


def _sent(answer: Callable[[Request, bytes], Response]) -> Answer:
    async def answered(request: Request) -> Response:
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            raise HTTPException(415, "the content type is not application/json")
        return await run_in_threadpool(answer, request, await request.body())

    return answered


def _pages(site: Site) -> list[Route]:
    def home(_: Request) -> Response:
        return HTMLResponse(home_page(site.workspace, site.told_runs(), site.tokens.token(HOME)))

    def run(request: Request) -> Response:
        return RedirectResponse(report_of(request.path_params["run"]))

    def in_run(request: Request) -> Response:
        return site.shown.file(request.path_params["run"], request.path_params["path"])

    def compared(request: Request) -> Response:
        given = request.path_params
        return site.shown.comparison(given["a"], given["b"], given.get("name") or "index.html")

    def plot(request: Request) -> Response:
        tried = re.fullmatch(r"[0-9a-f]{16}", request.path_params["name"])
        if tried is None:
            raise NotServed("no such plot")
        return OpenFile(open_file(site.runs.new, f"{TRIES}/{tried[0]}/{_PLOT}"), _PLOT)

    def review(request: Request) -> Response:
        chosen = asked(site.reviews, request)
        own = [run for run in site.told_runs() if run["target"] == chosen.target]
        runs = [{"key": run["key"], "name": run["key"]} for run in own]
        token = site.tokens.token(review_page(chosen.target))
        return HTMLResponse(site.reviews.page(chosen, request.url.query, runs, token))

    return [
        Route("/", _quick(home)),
        Route("/assets/{name:path}", _quick(_own)),
        Route("/runs/{run}/", _quick(run)),
        Route("/runs/{run}/{path:path}", _quick(in_run)),
        Route("/compare/{a}/{b}/", _quick(compared)),
        Route("/compare/{a}/{b}/{name}", _quick(compared)),
        Route(f"/{TRIES}/{{name}}/{_PLOT}", _quick(plot)),
        Route("/review/{target}", _quick(review)),
    ]


def _own(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in (*asset_names(".js"), *asset_names(".css")):
        raise NotServed("no such file")
    return Response(asset_text(name), media_type=kind_of(name))
