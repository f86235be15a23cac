"""The JSON interface for the pages' scripts."""

from urllib.parse import parse_qsl

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from mutator.errors import GroupsChanged, JobEnded, MutatorError
from mutator.serve.job_requests import Desk, Work
from mutator.serve.jobs import Jobs
from mutator.serve.page_tokens import HEADER, HOME, PageTokens, review_page, run_page
from mutator.serve.responses import error_facts
from mutator.serve.served_reviews import Decisions, Reviews, Selection
from mutator.serve.served_runs import Runs

_MOST_WORDS = 100  # the maximum number of parameters in an address


class ReviewApi:
    def __init__(self, reviews: Reviews, runs: Runs, tokens: PageTokens) -> None:
        self._reviews, self._runs, self._tokens = reviews, runs, tokens

    def told(self, request: Request) -> Response:
        return JSONResponse(self._reviews.told(asked(self._reviews, request)))

    def decide(self, request: Request, body: bytes) -> Response:
        """Save decisions, remarks and flags: all or none. Only the target's review page can send them."""
        self._tokens.check(_token(request), review_page(request.path_params["target"]))
        chosen, wanted = asked(self._reviews, request), Decisions.model_validate_json(body)
        try:
            return JSONResponse(self._reviews.decide(chosen, wanted))
        except GroupsChanged as moved:
            return JSONResponse({"conflict": moved.got, "groups": moved.groups}, 409)

    def changes(self, request: Request) -> Response:
        found = self._reviews.changes(asked(self._reviews, request), request.path_params["group"])
        return JSONResponse({"changes": found})

    def typical(self, request: Request) -> Response:
        """Return a group's results in a run; null if the run does not have the group."""
        run = self._runs.folder(request.query_params.get("run", ""))
        chosen = asked(self._reviews, request)
        return JSONResponse(self._reviews.typical(chosen, request.path_params["group"], run))

    def levels(self, request: Request) -> Response:
        chosen = asked(self._reviews, request)
        return JSONResponse({"levels": self._reviews.levels(chosen, request.path_params["group"])})

    def before(self, request: Request) -> Response:
        return self._picture(request, after=False)

    def after(self, request: Request) -> Response:
        return self._picture(request, after=True)

    def _picture(self, request: Request, *, after: bool) -> Response:
        given, chosen = request.path_params, asked(self._reviews, request)
        data = self._reviews.picture(chosen, given["group"], given["level"], after=after)
        return Response(data, media_type="image/jpeg")


class JobApi:
    """Jobs for the first page, which can start and cancel all, and for a report, which can start and cancel
    those of its run.
    """

    def __init__(self, desk: Desk, jobs: Jobs, tokens: PageTokens) -> None:
        self._desk, self._jobs, self._tokens = desk, jobs, tokens

    def told(self, _: Request) -> Response:
        return JSONResponse({"jobs": [job.told() for job in self._jobs.all()]})

    def submit(self, request: Request, body: bytes) -> Response:
        work = self._desk.work(body)
        self._check(request, work)
        return JSONResponse({"id": self._jobs.submit(work).id}, 201)

    def log(self, request: Request) -> Response:
        return JSONResponse({"log": self._jobs.get(request.path_params["job"]).text})

    def cancel(self, request: Request, _: bytes) -> Response:
        job = self._jobs.get(request.path_params["job"])
        self._check(request, job.work)
        try:
            self._jobs.cancel(job.id)
        except JobEnded as err:
            return JSONResponse(error_facts(err), 409)
        return JSONResponse({"id": job.id})

    def _check(self, request: Request, work: Work) -> None:
        pages = [run_page(work.run)] if work.run else []
        self._tokens.check(_token(request), HOME, *pages)


def _token(request: Request) -> str:
    return request.headers.get(HEADER, "")


def asked(reviews: Reviews, request: Request) -> Selection:
    """Return the groups that an address selects."""
    given = parse_qsl(request.url.query, keep_blank_values=True)
    if len(given) > _MOST_WORDS:
        raise MutatorError(f"{len(given)} parameters in the address", expected=f"at most {_MOST_WORDS}")
    if strange := [name for name, _ in given if name not in ("campaign", "spec", "run")]:
        raise MutatorError(
            f"unknown parameter '{strange[0]}' in the address", expected="'campaign' or 'spec'"
        )
    campaigns = [value for name, value in given if name == "campaign"]
    specs = [value for name, value in given if name == "spec"]
    if len(campaigns) > 1:
        raise MutatorError("several campaigns in the address", expected="one campaign")
    return reviews.selection(request.path_params["target"], campaigns[0] if campaigns else None, specs)
