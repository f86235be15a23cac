"""Check every request, and limit what a browser may do with a response.

Other pages in the user's browser and other users of the machine can reach a local port. So each request needs
the token, in a cookie that other sites cannot send. The request must not come from another origin. It must
name this server, because a page whose host name resolves to this machine could otherwise read responses.
"""

import hmac
from collections.abc import Iterable
from functools import cache
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from mutator.comparison import comparison_files
from mutator.web import asset_names, asset_text, csp_hash

HOST = "127.0.0.1"
MOST_BODY_BYTES = 1_000_000  # the longest body of a request
_ALLOWED_METHODS = ("GET", "HEAD", "POST")
_FRAME_DESTINATIONS = ("frame", "iframe", "object", "embed", "fencedframe")
_SAME_SITE_VALUES = (
    "same-origin",
    "none",
)  # what browsers send for a site's own pages and for typed addresses
# what they send with the requests of a page's script
_SCRIPT_FETCH_VALUES = {
    "sec-fetch-site": ("same-origin",),
    "sec-fetch-dest": ("empty",),
    "sec-fetch-mode": ("cors", "same-origin"),
}


class GuardedApplication:
    def __init__(self, app: ASGIApp, *, port: int, token: str) -> None:
        self._app, self._token, self._cookie = app, token, f"mutator-{port}"
        self._hosts = (f"{HOST}:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})  # policy violation
            return
        send = _with_security_headers(send)
        response = self._refusal_of(scope) or self._response_without_cookie(scope)
        if response is None and scope["method"] == "POST":
            body = await _read_body(Headers(scope=scope), receive)
            if body is None:
                response = _refusal_response("a body of more than 1 MB", 413)
            else:
                receive = _replay_body(body, receive)
        await (response or self._app)(scope, receive, send)

    def _refusal_of(self, scope: Scope) -> Response | None:
        headers, method = Headers(scope=scope), scope["method"]
        origins = headers.getlist("origin")
        if method not in _ALLOWED_METHODS:
            return _refusal_response(f"the method is not one of {', '.join(_ALLOWED_METHODS)}", 405)
        if len(hosts := headers.getlist("host")) != 1 or hosts[0] not in self._hosts:
            return _refusal_response("the request names another host")
        if len(origins) > 1 or any(origin != f"http://{hosts[0]}" for origin in origins):
            return _refusal_response("the request comes from another origin")
        if method == "POST" and not origins:
            return _refusal_response("the request has no origin")
        if method == "POST" and any(
            headers.get(name, expected[0]) not in expected for name, expected in _SCRIPT_FETCH_VALUES.items()
        ):
            return _refusal_response("the request does not come from the script of a page")
        destination = headers.get("sec-fetch-dest", "")
        if destination in _FRAME_DESTINATIONS:
            return _refusal_response("pages cannot be shown in other pages")
        if destination == "empty" and not scope["path"].startswith("/api/"):
            return _refusal_response("scripts cannot read pages, because pages contain tokens")
        if headers.get("sec-fetch-site", "none") not in _SAME_SITE_VALUES:
            return _refusal_response("the request comes from another site")
        return None

    def _response_without_cookie(self, scope: Scope) -> Response | None:
        """Return None if the cookie is valid; if the token is in the address, set the cookie and redirect."""
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        if scope["path"] == "/" and scope["method"] == "GET" and "token" in query:
            if not all(self._is_token(value) for value in query["token"]):
                return _refusal_response("wrong token: open the address that the server printed")
            redirect = RedirectResponse("/", 303)
            redirect.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
            return redirect
        if any(self._is_token(value) for value in _cookie_values(Headers(scope=scope), self._cookie)):
            return None
        return _refusal_response("no token: open the address that the server printed")

    def _is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self._token.encode())


def _cookie_values(headers: Headers, name: str) -> Iterable[str]:
    for line in headers.getlist("cookie"):
        for part in line.split(";"):
            key, _, value = part.strip().partition("=")
            if key == name:
                yield value


def _refusal_response(why: str, status: int = 403) -> Response:
    return PlainTextResponse(f"refused: {why}\n", status)


async def _read_body(headers: Headers, receive: Receive) -> bytes | None:
    """Read the body of a request; None if it is too long, whatever its declared length."""
    declared_length = headers.get("content-length", "0")
    if (
        not declared_length.isascii()
        or not declared_length.isdigit()
        or len(declared_length) > 20  # so that int() cannot take long
        or int(declared_length) > MOST_BODY_BYTES
    ):
        return None
    parts: list[bytes] = []
    size, has_more = 0, True
    while has_more:
        message = await receive()
        if message["type"] == "http.disconnect":
            break
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > MOST_BODY_BYTES:
            return None
        has_more = message.get("more_body", False)
    return b"".join(parts)


def _replay_body(body: bytes, receive: Receive) -> Receive:
    messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return messages.pop() if messages else await receive()

    return replay


def _with_security_headers(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", content_security_policy())
            headers["X-Content-Type-Options"] = "nosniff"
            headers["Referrer-Policy"] = "no-referrer"
            headers["Cross-Origin-Resource-Policy"] = "same-origin"
            headers["Cross-Origin-Opener-Policy"] = "same-origin"
            headers["Cache-Control"] = "no-store"
        await send(message)

    return guarded


@cache
def content_security_policy() -> str:
    """Return the policy for pages: they can run only code from `mutator.web`, as files or inline by hash."""
    scripts = [csp_hash(f"\n{asset_text(name)}") for name in asset_names(".js")]
    # a page of a comparison changes a style sheet
    sheets = dict.fromkeys((*map(asset_text, asset_names(".css")), *comparison_files.page_style_sheets()))
    styles = [csp_hash(f"\n{sheet}") for sheet in sheets]
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src 'self' {' '.join(scripts)}",
            f"style-src 'self' {' '.join(styles)}",
            "style-src-attr 'unsafe-inline'",  # the lengths of bars
            "img-src 'self' data:",
            "connect-src 'self'",
            "media-src 'self'",
            "frame-ancestors 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
