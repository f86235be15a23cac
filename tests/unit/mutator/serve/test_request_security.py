"""The server refuses requests from elsewhere."""

import base64
import hashlib
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import pytest

from mutator.serve.page_tokens import (
    HOME_PAGE,
    TOKEN_HEADER,
    TRIAL_PAGE,
    PageTokens,
    live_page_name,
    review_page_name,
    run_page_name,
)
from mutator.serve.request_security import MOST_BODY_BYTES
from mutator.serve.served_trials import TRIALS_FOLDER

from .conftest import TOKEN, Answer, Client

ASKED = (
    *("/", "/api/jobs", "/runs/night/report/index.html", "/assets/shared/base.css", "/nowhere"),
    *("/live/night", "/api/runs/night/live", "/trial/0123456789abcdef", "/api/trials/0123456789abcdef"),
)


@pytest.mark.parametrize(
    "host",
    ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost", "localhost.evil.example:{port}", "", None],
)
@pytest.mark.parametrize("path", ASKED)
def test_another_host_is_refused(client: Client, path: str, host: str | None) -> None:
    """Another name can resolve to this machine."""
    answer = client.get(path, Host=host and host.format(port=client.port))
    assert answer.status in (400, 403)
    assert "<" not in answer.text


def test_localhost_is_an_accepted_host(client: Client) -> None:
    assert client.get("/", Host=f"localhost:{client.port}").status == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://{own}", ""])
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_origin_is_refused(client: Client, method: str, origin: str) -> None:
    own = origin.format(own=f"127.0.0.1:{client.port}")
    answer = client.ask(method, "/api/jobs", {"Origin": own}, b"{}" if method == "POST" else None)
    assert answer.status == 403
    assert not [name for name in answer.headers if name.startswith("access-control")]


def test_a_post_needs_an_origin(client: Client) -> None:
    assert client.ask("POST", "/api/jobs", {"Origin": None}, b"{}").status == 403
    for site in ("cross-site", "same-site", "anything"):
        assert client.get("/api/jobs", Sec_Fetch_Site=site).status == 403
    assert client.get("/api/jobs", Sec_Fetch_Site="same-origin").status == 200


@pytest.mark.parametrize(
    "cookie", [None, "", "mutator-{port}=", "mutator-{port}=wrong", "mutator-1=" + TOKEN, TOKEN]
)
@pytest.mark.parametrize("path", ASKED)
def test_a_request_without_the_token_is_refused(client: Client, path: str, cookie: str | None) -> None:
    answer = client.get(path, Cookie=cookie and cookie.format(port=client.port))
    assert answer.status == 403
    assert "the server printed" in answer.text


def test_the_token_becomes_a_cookie(client: Client) -> None:
    answer = client.get(f"/?token={TOKEN}", Cookie=None)
    assert (answer.status, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert f"mutator-{client.port}={TOKEN}" in cookie
    assert "httponly" in cookie and "samesite=strict" in cookie


@pytest.mark.parametrize(
    "query", ["token=wrong", "token=", f"token={TOKEN}&token=wrong", f"token={TOKEN[:-1]}", "token=%ff"]
)
def test_a_wrong_token_is_refused_despite_a_valid_cookie(client: Client, query: str) -> None:
    answer = client.get(f"/?{query}")
    assert answer.status == 403
    assert "set-cookie" not in answer.headers


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "PROPFIND"])
def test_other_methods_are_refused(client: Client, method: str) -> None:
    answer = client.ask(method, "/api/jobs")
    assert answer.status == 405
    assert not [name for name in answer.headers if name.startswith("access-control")]


@pytest.mark.parametrize("chunked", [False, True])
def test_a_long_body_is_refused_with_and_without_a_length(client: Client, chunked: bool) -> None:
    body = b'{"kind": "' + b"x" * (MOST_BODY_BYTES + 10) + b'"}'
    assert client.ask("POST", "/api/jobs", body=body, chunked=chunked).status == 413


@pytest.mark.parametrize("length", ["99999999999999999999999", "1000001"])
def test_a_long_stated_length_is_refused_before_the_body_arrives(client: Client, length: str) -> None:
    with suppress(ConnectionResetError):  # if the body arrives after the end of the connection
        answer = client.ask("POST", "/api/jobs", {"Content-Length": length}, b"{}")
        assert answer.status in (400, 413)


def test_a_body_within_the_limit_is_read(client: Client) -> None:
    body = b'{"kind": "' + b"x" * (MOST_BODY_BYTES - 100) + b'"}'
    for chunked in (False, True):
        assert client.ask("POST", "/api/jobs", body=body, chunked=chunked).status == 400


@pytest.mark.parametrize("path", [*ASKED, "/?token=wrong"])
def test_every_response_has_the_policy(client: Client, path: str) -> None:
    policy = headers_of(client, path)["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'self' 'sha256-")
    assert "'unsafe-inline'" not in policy.replace("style-src-attr 'unsafe-inline'", "")
    for part in ("frame-ancestors 'none'", "base-uri 'none'", "form-action 'none'", "connect-src 'self'"):
        assert part in policy


def test_a_file_of_a_run_has_a_stricter_policy(client: Client) -> None:
    assert headers_of(client, "/runs/night/results.csv")["content-security-policy"].endswith("; sandbox")


def headers_of(client: Client, path: str) -> Mapping[str, str]:
    headers = client.get(path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    assert headers["cache-control"] == "no-store"
    assert headers["cross-origin-resource-policy"] == "same-origin"
    assert "server" not in headers
    return headers


@pytest.mark.parametrize("use", ["iframe", "frame", "object", "embed", "empty"])
@pytest.mark.parametrize(
    "path", ["/", "/runs/night/report/index.html", "/review/toycar", "/live/night", "/trial/0123456789abcdef"]
)
def test_a_page_is_neither_framed_nor_read_by_scripts(client: Client, path: str, use: str) -> None:
    """Its token would be readable, or its buttons could be disguised."""
    if path.startswith("/trial/"):  # its page needs no more than the folder
        (client.site.runs.folder_for_new_runs / TRIALS_FOLDER / path.rpartition("/")[2]).mkdir(
            parents=True, exist_ok=True
        )
    assert client.get(path, Sec_Fetch_Dest="document", Sec_Fetch_Site="none").status == 200
    answer = client.get(path, Sec_Fetch_Dest=use, Sec_Fetch_Site="same-origin")
    assert answer.status == 403
    assert "<" not in answer.text
    assert client.get("/api/jobs", Sec_Fetch_Dest="empty").status == 200


@pytest.mark.parametrize(
    "header",
    [("Mode", "navigate"), ("Mode", "no-cors"), ("Dest", "document"), ("Site", "none")],
)
def test_only_a_script_can_post(client: Client, header: tuple[str, str]) -> None:
    usual = {"Sec-Fetch-Mode": "cors", "Sec-Fetch-Dest": "empty", "Sec-Fetch-Site": "same-origin"}
    assert client.ask("POST", "/api/jobs", usual, b"{}").status == 400
    assert client.ask("POST", "/api/jobs", usual | {f"Sec-Fetch-{header[0]}": header[1]}, b"{}").status == 403


PAGES = (
    HOME_PAGE,
    TRIAL_PAGE,
    live_page_name(Path("/elsewhere")),
    run_page_name(Path("/elsewhere")),
    review_page_name("toycar"),
    review_page_name("other"),
)


def strangers(client: Client, *allowed: str) -> list[str]:
    """The tokens of all other pages, and no token."""
    night, linked = (run_page_name(client.place / "runs" / name) for name in ("night", "linked"))
    tokens = [client.site.tokens.token_of(page) for page in {*PAGES, night, linked} - {*allowed}]
    return [*tokens, "", "a", "\xff", PageTokens().token_of(allowed[0])]


def test_only_the_review_page_decides(client: Client) -> None:
    path, own = "/api/review/toycar", review_page_name("toycar")
    [group, *_] = groups = client.get(path).json["groups"]
    facts = groups[group]
    body = {
        "changes": [{"group": group, "kind": "approve"}],
        "by": "Jane",
        "seen": {group: facts["revision"]},
        "digests": {group: facts["digest"]},
    }
    for token in strangers(client, own):
        assert client.ask("POST", path, {TOKEN_HEADER: token}, body).status == 403
    assert client.get(path).json["groups"][group]["state"] == "new"
    assert client.ask("POST", path, {TOKEN_HEADER: client.site.tokens.token_of(own)}, body).status == 200
    assert client.get(path).json["groups"][group]["state"] == "approved"


def test_a_run_page_starts_and_cancels_only_jobs_of_its_run(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    night = run_page_name(client.place / "runs" / "night")
    own = client.site.tokens.token_of(night)
    orders: list[dict[str, object]] = [
        {"kind": "report", "run": "night"},
        {"kind": "try", "spec": "sensor/distance", "scenario": "near"},
        {"kind": "campaign", "campaign": "small", "name": "night"},
    ]
    for order in orders:
        allowed = (HOME_PAGE, TRIAL_PAGE) if order["kind"] == "try" else (HOME_PAGE, night)
        for token in [*strangers(client, *allowed), *([own] if "run" not in order else [])]:
            assert client.ask("POST", "/api/jobs", {TOKEN_HEADER: token}, order).status in (400, 403)
    assert not client.get("/api/jobs").json["jobs"]
    monkeypatch.setattr(client.site.jobs, "_start_process", lambda job, events: None)
    ids = [client.ask("POST", "/api/jobs", {TOKEN_HEADER: own}, orders[0]).json["id"]]
    ids += [client.post("/api/jobs", order).json["id"] for order in orders[:1]]
    campaign = client.post("/api/jobs", orders[2] | {"name": "later"}).json["id"]
    for token in [*strangers(client, HOME_PAGE, night), own]:
        assert client.ask("POST", f"/api/jobs/{campaign}/cancel", {TOKEN_HEADER: token}, {}).status == 403
    states = {job["id"]: job["state"] for job in client.get("/api/jobs").json["jobs"]}
    assert states == dict.fromkeys([*ids, campaign], "queued")
    for job, token in ((ids[0], own), (ids[1], own), (campaign, client.token_for("/api/jobs"))):
        assert client.ask("POST", f"/api/jobs/{job}/cancel", {TOKEN_HEADER: token}, {}).status == 200


def test_the_pages_of_a_trial_and_of_a_watched_run_start_and_cancel_only_their_own_jobs(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client.site.jobs, "_start_process", lambda job, events: None)
    orders = {
        TRIAL_PAGE: {"kind": "try", "spec": "sensor/distance", "scenario": "A"},
        live_page_name(client.place / "runs" / "watched"): {
            "kind": "campaign",
            "campaign": "small",
            "name": "watched",
        },
    }
    for page, order in orders.items():
        headers = {TOKEN_HEADER: client.site.tokens.token_of(page)}
        for other, its_order in orders.items():
            if other != page:
                assert client.ask("POST", "/api/jobs", headers, its_order).status == 403
        assert client.ask("POST", "/api/jobs", headers, {"kind": "report", "run": "night"}).status == 403
        job = client.ask("POST", "/api/jobs", headers, order).json["id"]
        for token in strangers(client, HOME_PAGE, page):
            assert client.ask("POST", f"/api/jobs/{job}/cancel", {TOKEN_HEADER: token}, {}).status == 403
        assert client.ask("POST", f"/api/jobs/{job}/cancel", headers, {}).status == 200


def blocks(page: str, tag: str) -> list[str]:
    """Return the contents of the page's `tag` elements that a browser would run or apply."""
    found = re.findall(rf"<{tag}( type=[^>]*)?>(.*?)</{tag}>", page, re.DOTALL)
    return [text for kind, text in found if not kind]


def check_policy(answer: Answer) -> None:
    carried = blocks(answer.text, "script") + blocks(answer.text, "style")
    assert carried
    for text in carried:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in answer.headers["content-security-policy"], text[:200]
    assert not re.search(r"<[a-z][^>]* on[a-z]+=", answer.text)


@pytest.mark.parametrize("path", ["/runs/night/report/index.html", "/review/toycar"])
def test_the_policy_allows_our_scripts_and_style_sheets(client: Client, path: str) -> None:
    answer = client.get(path)
    assert answer.status == 200, answer.text
    check_policy(answer)
