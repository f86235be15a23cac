"""The JSON interface for the pages' scripts."""

from urllib.parse import parse_qsl

from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from mutator.errors import GroupsChanged, JobAlreadyEnded, MutatorError
from mutator.serve.http_responses import error_as_json
from mutator.serve.job_queue import ServeJobs
from mutator.serve.job_requests import JobCommand, RequestChecker
from mutator.serve.page_tokens import HOME_PAGE, TOKEN_HEADER, PageTokens, review_page_name
from mutator.serve.served_reviews import GroupSelection, SentDecisions, ServedReviews
from mutator.serve.served_runs import ServedRuns

_MOST_PARAMETERS = 100  # the maximum number of parameters in an address


class ReviewApi:
    def __init__(self, reviews: ServedReviews, runs: ServedRuns, tokens: PageTokens) -> None:
        self._reviews, self._runs, self._tokens = reviews, runs, tokens

    def group_reviews(self, request: Request) -> Response:
        return JSONResponse(self._reviews.group_reviews(selected_groups(self._reviews, request)))

    def decide(self, request: Request, body: bytes) -> Response:
        """Save decisions, remarks and flags: all or none. Only the target's review page can send them."""
        self._tokens.check_page(_token_of(request), review_page_name(request.path_params["target"]))
        selection, decisions = (
            selected_groups(self._reviews, request),
            SentDecisions.model_validate_json(body),
        )
        try:
            return JSONResponse(self._reviews.decide(selection, decisions))
        except GroupsChanged as conflict:
            return JSONResponse({"conflict": conflict.got, "groups": conflict.groups}, 409)

    def changes_since_decision(self, request: Request) -> Response:
        diff = self._reviews.diff_since_decision(
            selected_groups(self._reviews, request), request.path_params["group"]
        )
        return JSONResponse({"changes": diff})

    def typical_results(self, request: Request) -> Response:
        """Return a group's results in a run; null if the run does not have the group."""
        run = self._runs.folder(request.query_params.get("run", ""))
        selection = selected_groups(self._reviews, request)
        return JSONResponse(self._reviews.typical_results(selection, request.path_params["group"], run))

    def picture_levels(self, request: Request) -> Response:
        selection = selected_groups(self._reviews, request)
        return JSONResponse({"levels": self._reviews.picture_levels(selection, request.path_params["group"])})

    def picture_before(self, request: Request) -> Response:
        return self._picture(request, after=False)

    def picture_after(self, request: Request) -> Response:
        return self._picture(request, after=True)

    def _picture(self, request: Request, *, after: bool) -> Response:
        parameters, selection = request.path_params, selected_groups(self._reviews, request)
        data = self._reviews.picture(selection, parameters["group"], parameters["level"], after=after)
        return Response(data, media_type="image/jpeg")


class JobApi:
    """Jobs for the first page, which can start and cancel all, and for the page of a report, a watched run or
    a trial, which can start and cancel its own.
    """

    def __init__(self, request_checker: RequestChecker, jobs: ServeJobs, tokens: PageTokens) -> None:
        self._request_checker, self._jobs, self._tokens = request_checker, jobs, tokens

    def list_jobs(self, _: Request) -> Response:
        return JSONResponse({"jobs": [job.as_json() for job in self._jobs.all()]})

    def submit(self, request: Request, body: bytes) -> Response:
        command = self._request_checker.build_command(body)
        self._check_token(request, command)
        return JSONResponse({"id": self._jobs.submit(command).id}, 201)

    def log(self, request: Request) -> Response:
        return JSONResponse({"log": self._jobs.get(request.path_params["job"]).log_text})

    def cancel(self, request: Request, _: bytes) -> Response:
        job = self._jobs.get(request.path_params["job"])
        self._check_token(request, job.job_command)
        try:
            self._jobs.cancel(job.id)
        except JobAlreadyEnded as err:
            return JSONResponse(error_as_json(err), 409)
        return JSONResponse({"id": job.id})

    def _check_token(self, request: Request, command: JobCommand) -> None:
        pages = [command.requesting_page] if command.requesting_page else []
        self._tokens.check_page(_token_of(request), HOME_PAGE, *pages)


def _token_of(request: Request) -> str:
    return request.headers.get(TOKEN_HEADER, "")


def selected_groups(reviews: ServedReviews, request: Request) -> GroupSelection:
    """Return the groups that an address selects."""
    parameters = parse_qsl(request.url.query, keep_blank_values=True)
    if len(parameters) > _MOST_PARAMETERS:
        raise MutatorError(
            f"{len(parameters)} parameters in the address", expected=f"at most {_MOST_PARAMETERS}"
        )
    if unknown := [name for name, _ in parameters if name not in ("campaign", "spec", "run")]:
        raise MutatorError(
            f"unknown parameter '{unknown[0]}' in the address", expected="'campaign' or 'spec'"
        )
    campaigns = [value for name, value in parameters if name == "campaign"]
    specs = [value for name, value in parameters if name == "spec"]
    if len(campaigns) > 1:
        raise MutatorError("several campaigns in the address", expected="one campaign")
    return reviews.checked_selection(
        request.path_params["target"], campaigns[0] if campaigns else None, specs
    )
