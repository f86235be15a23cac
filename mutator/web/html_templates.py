"""The Jinja environment of the pages' templates."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mutator.web import asset_text

if TYPE_CHECKING:
    from jinja2 import Environment


def html_environment(finalize: Callable[[Any], Any] | None = None) -> "Environment":
    """Return an environment whose templates can include assets by name, such as `shared/head.html`.

    Values that are not Markup are escaped, after `finalize`.
    """
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=finalize,
        loader=FunctionLoader(asset_text),
    )
