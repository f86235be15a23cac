"""The first page, the choices in its forms, and the error page."""

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined

from mutator.errors import MutatorError
from mutator.web import asset_text
from mutator.workspace import Workspace

_MOST_PAIRS = 20  # pairs of runs offered for comparison


def home_page(workspace: Workspace, runs: Sequence[Mapping[str, Any]], token: str) -> str:
    targets = tuple(workspace.targets)
    return _render_html_page(
        "home.html", runs=runs, pairs=_consecutive_comparable_pairs(runs), targets=targets, token=token
    )


def error_page(facts: Mapping[str, Any]) -> str:
    return _render_html_page("error.html", **facts)


def form_choices(workspace: Workspace) -> dict[str, Any]:
    """Return the choices in the forms. The first entry that cannot be read is reported as `problem`."""
    names = ("targets", "scenarios", "campaigns")
    choices: dict[str, Any] = {name: [*getattr(workspace, name)] for name in names}
    choices |= {"specs": [], "contexts": [], "readings": [], "problem": None}
    try:
        choices["readings"] = [*workspace.readings().names]
        choices["contexts"] = [
            {"name": row.id, "condition": row.condition}
            for table in map(workspace.context_table, workspace.context_tables)
            for row in table.rows
        ]
        choices["specs"] = [
            {"name": spec.name, "variants": [variant.name for variant in spec]} for spec in workspace.specs()
        ]
    except MutatorError as err:
        choices["problem"] = err.got
    return choices


def _consecutive_comparable_pairs(runs: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Return pairs of consecutive runs with the same campaign and target."""
    latest: dict[tuple[str, str], str] = {}
    pairs = []
    for run in runs:
        if run["outcomes"]:
            kind = (run["campaign"], run["target"])
            if kind in latest:
                pairs.append((latest[kind], run["key"]))
            latest[kind] = run["key"]
    return pairs[-_MOST_PAIRS:]


def _render_html_page(name: str, **content: Any) -> str:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["quoted"] = lambda text: quote(text, safe="")
    text = asset_text(f"serve/{name}")
    return environment.from_string(text).render(content)
