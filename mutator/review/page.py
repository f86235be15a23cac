"""The review page: every group with its state, diff and values, in one self-contained file."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.mutants.probe import tag_words
from mutator.review.catalogue import Group
from mutator.review.decisions import Review, State
from mutator.review.readable_groups import condition_lines, value_table
from mutator.web import asset, embedded, plainly_embedded

STYLES = ("base.css", "review.css")
SCRIPTS = ("dom.js", "packed.js", "diff.js", "review.js")


def write_page(out: Path, review: Review, groups: Sequence[Group], options: Sequence[str]) -> None:
    """Write the page of `groups`; the commands on it have these `options`, which select the groups."""
    try:
        write_atomic(out, page_html(review, groups, options).encode())
    except OSError as err:
        raise MutatorError(
            f"cannot be written ({err.strerror})", where=out, remedy="name another file"
        ) from None


def page_html(
    review: Review,
    groups: Sequence[Group],
    options: Sequence[str],
    served: Mapping[str, Any] | None = None,
) -> str:
    """The page of `groups`. `served` is what a page needs that a server shows (target, reviewer, where to
    send decisions, runs); None for a file."""
    data = {
        "target": review.target,
        "states": [state.value for state in State],
        "options": shlex.join(options),
        "groups": [_group(review, group) for group in groups],
        "served": served,
    }
    return render_page(data)


def render_page(data: dict[str, Any]) -> str:
    """The page as HTML; the same groups and decisions give the same text."""
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset("review.html")).render(
        target=data["target"],
        count=len(data["groups"]),
        styles=[Markup(asset(name)) for name in STYLES],
        tags=Markup(plainly_embedded(tag_words(), "tags")),
        data=Markup(embedded(data, "review")),
        scripts=[Markup(asset(name)) for name in SCRIPTS],
    )


def _group(review: Review, group: Group) -> dict[str, Any]:
    heads, rows = value_table(group)
    return {
        "id": group.id,
        "state": review.state(group).value,
        "decision": review.describe(group),
        "injections": group.injections,
        "specs": group.specs,
        "trigger": group.trigger,
        "hold": group.hold,
        "conditions": condition_lines(group.triggers),
        "faults": len(group.faults),
        "runs": group.runs,
        "diff": group.diff,
        "heads": heads,
        "rows": rows,
    }
