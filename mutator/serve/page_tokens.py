"""Tokens by which the server recognises the page that sends a request.

The cookie says who asks, and every page sends it. Only a page that the server built also carries a token,
and its script sends the token along. So a decision comes from the review's own page, and a job from the page
of its run, from that of a trial, or from the first page.
"""

import hashlib
import hmac
import secrets
from dataclasses import dataclass, field
from pathlib import Path

from mutator.errors import RequestFromWrongPage

TOKEN_HEADER = "x-mutator-page"
HOME_PAGE = "home"
TRIAL_PAGE = "trial"  # every trial: the page of one starts the next


@dataclass(frozen=True, slots=True)
class PageTokens:
    """The tokens of one server. They are no longer valid when it has ended."""

    _key: bytes = field(default_factory=lambda: secrets.token_bytes(32))

    def token_of(self, page: str) -> str:
        # names of folders need not be valid UTF-8
        return hmac.new(self._key, page.encode("utf-8", "surrogateescape"), hashlib.sha256).hexdigest()

    def check_page(self, token: str, *pages: str) -> None:
        """Raise RequestFromWrongPage unless the token is that of one of these pages."""
        if not any(hmac.compare_digest(self.token_of(page).encode(), token.encode()) for page in pages):
            raise RequestFromWrongPage(
                "the request does not come from the page that may send it",
                remedy="reload the page; start other jobs on the first page",
            )


def run_page_name(folder: Path) -> str:
    """Return the name of a run's report for `PageTokens`."""
    return f"run {folder}"


def live_page_name(folder: Path) -> str:
    """Return the name of the page that watches a run."""
    return f"live {folder}"


def review_page_name(target: str) -> str:
    return f"review {target}"
