"""HTTP responses: files, JSON and errors, none of which contains an absolute path."""

import os
import re
import tempfile
from pathlib import Path
from typing import Any, BinaryIO

from pydantic import ValidationError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.types import Receive, Scope, Send

from mutator.errors import MutatorError, NotServed, RequestFromWrongPage
from mutator.serve.home_live_trial_and_error_pages import error_page

_MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".csv": "text/csv; charset=utf-8",
    ".gif": "image/gif",
    ".html": "text/html; charset=utf-8",
    ".jpg": "image/jpeg",
    ".js": "application/javascript",  # no charset, because each byte of a series is a character
    ".md": "text/plain; charset=utf-8",
    ".mp4": "video/mp4",
    ".png": "image/png",
    ".svg": "image/svg+xml",
}
# For files that somebody else may have written: as pages of no origin, which run and load nothing. The styles
# are those of figures.
UNTRUSTED_FILE_HEADERS = {"Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; sandbox"}
_FOLDERS_PATTERN = re.compile(r"(?<![\w.~-])/(?!dev/null)(?:[^/\s'\"`]+/)+")


class OpenFileResponse(FileResponse):
    """Sends an open file, and then closes it."""

    def __init__(self, file: BinaryIO, name: str) -> None:
        self._file = file
        place, facts = f"/proc/self/fd/{file.fileno()}", os.fstat(file.fileno())
        super().__init__(
            place, media_type=media_type_of(name), headers=UNTRUSTED_FILE_HEADERS, stat_result=facts
        )

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._file.close()


def media_type_of(name: str) -> str:
    return _MEDIA_TYPES[Path(name).suffix]


def without_absolute_folders(text: str) -> str:
    """Shorten absolute paths in a text."""
    for folder, instead in ((Path.cwd(), ""), (Path.home(), "/_/"), (Path(tempfile.gettempdir()), "/_/")):
        if folder != Path("/"):
            text = text.replace(f"{folder}/", instead)  # names can contain spaces
    return _FOLDERS_PATTERN.sub("", text)


def error_as_json(error: MutatorError) -> dict[str, Any]:
    place = error.where or error.argument
    parts = {"got": error.got, "where": place, "expected": error.expected, "remedy": error.remedy}
    facts: dict[str, Any] = {
        name: without_absolute_folders(text) if text else None for name, text in parts.items()
    }
    if error.where and error.line is not None:
        facts["where"] += f":{error.line}"
    return {"error": facts}


def error_response(request: Request, error: Exception) -> Response:
    """Return the response to a failed request: JSON for scripts, a page for people."""
    failure = _as_mutator_error(error)
    status = (
        404 if isinstance(failure, NotServed) else 403 if isinstance(failure, RequestFromWrongPage) else 400
    )
    if isinstance(error, HTTPException):
        status = error.status_code
    facts = error_as_json(failure)
    if request.url.path.startswith("/api/"):
        return JSONResponse(facts, status)
    return Response(error_page(facts["error"]), status, media_type="text/html")


def _as_mutator_error(error: Exception) -> MutatorError:
    if isinstance(error, MutatorError):
        return error
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return MutatorError(str(first["msg"]), where=".".join(map(str, first["loc"])) or None)
    if isinstance(error, HTTPException) and error.status_code != 404:
        return MutatorError(error.detail)
    return NotServed("no such page", remedy="go back to the first page")
