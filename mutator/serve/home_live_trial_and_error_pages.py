"""The first page, the choices in its forms, and the error page."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from mutator.config.yaml_files import load_yaml
from mutator.errors import MutatorError
from mutator.mutants.injected_line_syntax import tags_for_page_scripts
from mutator.serve.served_trials import range_as_json
from mutator.web import asset_text, json_script_element, load_order
from mutator.web.html_templates import html_environment
from mutator.workspace import Workspace

_EXPERIMENT_SCRIPT, _PATH_SCRIPT = "report/experiment.js", "report/path.js"


def home_page(workspace: Workspace, runs: Sequence[Mapping[str, Any]], token: str) -> str:
    """Return the first page; `runs` are the served runs, the newest first."""
    targets = tuple(workspace.targets)
    compared = [run for run in runs if run["outcomes"] and run["state"] != "running"]
    by_campaign = {
        run["campaign"]: [r for r in compared if r["campaign"] == run["campaign"]] for run in compared
    }
    return _render_html_page(
        "serve/home.html",
        runs=runs,
        runs_by_campaign=by_campaign if len(compared) > 1 else {},
        suggestion=_newest_comparable_pair(compared),
        targets=targets,
        token=token,
    )


def live_page(key: str, token: str) -> str:
    """Return the page that watches the run with this key."""
    return _render_html_page("serve/live.html", key=key, token=token)


def trial_page(data_address: str, back_address: str, back_text: str, *, token: str) -> str:
    """Return the page of one experiment, whose data its script gets from `data_address`."""
    styles = (*load_order("report", ".css"), *load_order("serve", ".css"), *load_order("trial", ".css"))
    of_report = load_order("report", ".js")
    # later ones show a whole run, and the path needs the data of one
    scripts = [name for name in of_report[: of_report.index(_EXPERIMENT_SCRIPT) + 1] if name != _PATH_SCRIPT]
    return _render_html_page(
        "trial/trial.html",
        data_address=data_address,
        back_address=back_address,
        back_text=back_text,
        token=token,
        styles=styles,
        scripts=(*scripts, *load_order("trial", ".js")),
        tags=Markup(json_script_element(tags_for_page_scripts(), "tags")),
    )


def error_page(facts: Mapping[str, Any]) -> str:
    return _render_html_page("serve/error.html", **facts)


def form_choices(workspace: Workspace) -> dict[str, Any]:
    """Return the choices in the forms, with what each is, in words. The first entry that cannot be read is
    reported as `problem`.
    """
    choices: dict[str, Any] = {"targets": [*workspace.targets]}
    choices |= {
        "scenarios": [],
        "campaigns": [],
        "specs": [],
        "contexts": [],
        "readings": [],
        "problem": None,
    }
    try:
        for names, files in (("scenarios", workspace.scenarios), ("campaigns", workspace.campaigns)):
            choices[names] = [_described_file(name, path) for name, path in files.items()]
        readings = workspace.readings()
        choices["readings"] = [
            {"name": name, "about": about}
            for name, about in zip(readings.names, readings.descriptions, strict=True)
        ]
        choices["contexts"] = [
            {"name": row.id, "condition": row.condition, "table": table.name}
            for table in map(workspace.context_table, workspace.context_tables)
            for row in table.rows
        ]
        choices["specs"] = [
            {
                "name": spec.name,
                "module": spec.module,
                "about": spec.about,
                "variants": [
                    {"name": variant.name, "about": variant.about, "range": range_as_json(variant)}
                    for variant in spec
                ],
            }
            for spec in workspace.specs()
        ]
    except MutatorError as err:
        choices["problem"] = err.got
    return choices


def _described_file(name: str, path: Path) -> dict[str, Any]:
    """Return a scenario or campaign, with its title, '' if its file has a format of its own, and whether it
    explores.
    """
    try:
        data = load_yaml(path).data
    except MutatorError:
        data = None
    values = data if isinstance(data, dict) else {}
    about = values.get("title") or values.get("about")
    title = about.strip() if isinstance(about, str) else ""
    return {"name": name, "about": title, "explores": "explore" in values}


def _newest_comparable_pair(runs: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Return the newest run with an earlier one of the same campaign and target, the older one first; without
    such a pair, the two newest.
    """
    for number, run in enumerate(runs):
        for earlier in runs[number + 1 :]:
            if (earlier["campaign"], earlier["target"]) == (run["campaign"], run["target"]):
                return earlier["key"], run["key"]
    newest = [run["key"] for run in runs[:2]]
    return (newest[-1], newest[0]) if newest else ("", "")


def _render_html_page(name: str, **content: Any) -> str:
    environment = html_environment()
    environment.filters["quoted"] = lambda text: quote(text, safe="")
    environment.filters["moment"] = _describe_moment
    environment.filters["state"] = _describe_state
    text = asset_text(name)
    return environment.from_string(text).render(content)


def _describe_moment(seconds: float) -> str:
    """Return a time in s since 1970 as local time; '' if unknown."""
    return datetime.fromtimestamp(seconds).strftime("%Y-%m-%d %H:%M") if seconds else ""


def _describe_state(run: Mapping[str, Any]) -> str:
    """Return the state of a run with its stage or problem; web/serve/runs.js writes the same."""
    return ": ".join(str(run[name]) for name in ("state", "stage", "problem") if run[name])
