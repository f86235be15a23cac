"""Check every request, and limit what a browser may do with a response.

Other pages in the user's browser and other users of the machine can reach a local port. So each request needs
the token, in a cookie that other sites cannot send. The request must not come from another origin. It must
name this server, because a page whose host name resolves to this machine could otherwise read responses.
"""

import base64
import hashlib
import hmac
from collections.abc import Iterable
from functools import cache
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from mutator.comparison import comparison_files
from mutator.web import asset_names, asset_text

HOST = "127.0.0.1"
MOST_BYTES = 1_000_000  # the longest body of a request
_METHODS = ("GET", "HEAD", "POST")
_FRAMES = ("frame", "iframe", "object", "embed", "fencedframe")
_OWN_SITE = ("same-origin", "none")  # what browsers send for a site's own pages and for typed addresses
# what they send with the requests of a page's script
_OWN_SCRIPT = {
    "sec-fetch-site": ("same-origin",),
    "sec-fetch-dest": ("empty",),
    "sec-fetch-mode": ("cors", "same-origin"),
}


class Guarded:
    def __init__(self, app: ASGIApp, *, port: int, token: str) -> None:
        self._app, self._token, self._cookie = app, token, f"mutator-{port}"
        self._hosts = (f"{HOST}:{port}", f"localhost:{port}")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return
        send = _with_policy(send)
        answer = self._refused(scope) or self._entered(scope)
        if answer is None and scope["method"] == "POST":
            body = await _body(Headers(scope=scope), receive)
            if body is None:
                answer = _refusal("a body of more than 1 MB", 413)
            else:
                receive = _replayed(body, receive)
        await (answer or self._app)(scope, receive, send)

    def _refused(self, scope: Scope) -> Response | None:
        headers, method = Headers(scope=scope), scope["method"]
        origins = headers.getlist("origin")
        if method not in _METHODS:
            return _refusal(f"the method is not one of {', '.join(_METHODS)}", 405)
        if len(hosts := headers.getlist("host")) != 1 or hosts[0] not in self._hosts:
            return _refusal("the request names another host")
        if len(origins) > 1 or any(origin != f"http://{hosts[0]}" for origin in origins):
            return _refusal("the request comes from another origin")
        if method == "POST" and not origins:
            return _refusal("the request has no origin")
        if method == "POST" and any(
            headers.get(name, own[0]) not in own for name, own in _OWN_SCRIPT.items()
        ):
            return _refusal("the request does not come from the script of a page")
        use = headers.get("sec-fetch-dest", "")
        if use in _FRAMES:
            return _refusal("pages cannot be shown in other pages")
        if use == "empty" and not scope["path"].startswith("/api/"):
            return _refusal("scripts cannot read pages, because pages contain tokens")
        if headers.get("sec-fetch-site", "none") not in _OWN_SITE:
            return _refusal("the request comes from another site")
        return None

    def _entered(self, scope: Scope) -> Response | None:
        """Return None if the cookie is valid; if the token is in the address, set the cookie and redirect."""
        query = parse_qs(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        if scope["path"] == "/" and scope["method"] == "GET" and "token" in query:
            if not all(self._is_token(given) for given in query["token"]):
                return _refusal("wrong token: open the address that the server printed")
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict")
            return answer
        if any(self._is_token(given) for given in _cookies(Headers(scope=scope), self._cookie)):
            return None
        return _refusal("no token: open the address that the server printed")

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _cookies(headers: Headers, name: str) -> Iterable[str]:
    for line in headers.getlist("cookie"):
        for part in line.split(";"):
            key, _, value = part.strip().partition("=")
            if key == name:
                yield value


def _refusal(why: str, status: int = 403) -> Response:
    return PlainTextResponse(f"refused: {why}\n", status)


async def _body(headers: Headers, receive: Receive) -> bytes | None:
    """Read the body of a request; None if it is too long, whatever its declared length."""
    told = headers.get("content-length", "0")
    if not told.isascii() or not told.isdigit() or len(told) > 20 or int(told) > MOST_BYTES:
        return None
    parts: list[bytes] = []
    size, more = 0, True
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            break
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > MOST_BYTES:
            return None
        more = message.get("more_body", False)
    return b"".join(parts)


def _replayed(body: bytes, receive: Receive) -> Receive:
    messages: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def replay() -> Message:
        return messages.pop() if messages else await receive()

    return replay


def _with_policy(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", policy())
            headers["X-Content-Type-Options"] = "nosniff"
            headers["Referrer-Policy"] = "no-referrer"
            headers["Cross-Origin-Resource-Policy"] = "same-origin"
            headers["Cross-Origin-Opener-Policy"] = "same-origin"
            headers["Cache-Control"] = "no-store"
        await send(message)

    return guarded


@cache
def policy() -> str:
    """Return the policy for pages: they can run only code from `mutator.web`, as files or inline by hash."""
    scripts = [_hash(f"\n{asset_text(name)}") for name in asset_names(".js")]
    styles = [_hash(f"\n{asset_text(name)}") for name in asset_names(".css")] + [
        _hash(f"\n{comparison_files.page_style()}")
    ]
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


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
