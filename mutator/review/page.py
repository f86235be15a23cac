"""The review page: every group with its state, diff and values, in one file that needs nothing else."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.review.catalogue import Group
from mutator.review.decisions import Review, State
from mutator.review.words import conditions, values
from mutator.web import asset, embedded

STYLES = ("base.css", "review.css")
SCRIPTS = ("dom.js", "packed.js", "diff.js", "review.js")


def write_page(out: Path, review: Review, groups: Sequence[Group], options: Sequence[str]) -> None:
    """Write the page of `groups`; its commands name what is reviewed by `options`."""
    data = {
        "target": review.target,
        "states": [state.value for state in State],
        "options": shlex.join(options),
        "groups": [_group(review, group) for group in groups],
    }
    try:
        write_atomic(out, page(data).encode())
    except OSError as err:
        raise MutatorError(
            f"cannot be written ({err.strerror})", where=out, remedy="name another file"
        ) from None


def page(data: dict[str, Any]) -> str:
    """The page as text: the same each time for the same groups and decisions."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(asset("review.html")).render(
        target=data["target"],
        count=len(data["groups"]),
        styles=[Markup(asset(name)) for name in STYLES],
        data=Markup(embedded(data, "review")),
        scripts=[Markup(asset(name)) for name in SCRIPTS],
    )


def _group(review: Review, group: Group) -> dict[str, Any]:
    heads, rows = values(group)
    return {
        "id": group.id,
        "state": review.state(group).value,
        "told": review.told(group),
        "injections": group.injections,
        "specs": group.specs,
        "trigger": group.trigger,
        "hold": group.hold,
        "conditions": conditions(group.triggers),
        "faults": len(group.faults),
        "runs": group.runs,
        "diff": group.diff,
        "heads": heads,
        "rows": rows,
    }
