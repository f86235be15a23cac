"""A report as one file that can be sent: the page, with the replays of the worst experiments inside.

The page requests nothing and links to no other file.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from markupsafe import Markup

from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.report.experiment_list_data import (
    MOST_EMBEDDED_STILL_BYTES,
    ExperimentListData,
    media_by_experiment,
    most_listed_experiments,
)
from mutator.report.panel import REPORT_FOLDER
from mutator.report.report_markdown_and_html import ReportContent, report_html
from mutator.report.reported_run import ReportedRun
from mutator.store.embedded_series import (
    EMBEDDED_SERIES_ELEMENT,
    MOST_EMBEDDED_SERIES_BYTES,
    EmbeddedSeries,
    embed_worst,
)
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.web import json_script_element, packed_script_element

SINGLE_FILE_FOLDER, SINGLE_FILE_SUFFIX = "exports", "-report.html"


def single_file_name(run_name: str) -> str:
    """Return the path of the file in the run folder. It contains the run's name, because the file is sent."""
    return f"{SINGLE_FILE_FOLDER}/{run_name}{SINGLE_FILE_SUFFIX}"


def single_file_html(content: ReportContent, run: ReportedRun) -> str:
    """Return the page of a report that works without any other file."""
    ids, series = _ids_worst_first(run), TimeSeriesFolder(run.folder.path)
    embedded, last_rank = embed_worst(series, map(run.records.get, ids), MOST_EMBEDDED_SERIES_BYTES)
    is_cut = last_rank < min(len(run.results), most_listed_experiments(run))
    alone = {
        "last_rank": last_rank,
        "reason_beyond": _describe_limit(last_rank),
        "unreadable": [
            name for name in ids[:last_rank] if name not in embedded and _has_series(series, name)
        ],
    }
    alone_content = replace(
        content.on_one_page(),
        replays_note=_describe_replays(embedded, last_rank, is_cut=is_cut),
        experiment_list=_list_data_alone(content.experiment_list, run, embedded, alone),
    )
    return report_html(alone_content, is_alone=True)


def _ids_worst_first(run: ReportedRun) -> list[str]:
    order = run.experiment_facts.worst_first_ranks.argsort(kind="stable")[: most_listed_experiments(run)]
    return [str(name) for name in run.results["experiment_id"].to_numpy()[order]]


def _has_series(series: TimeSeriesFolder, experiment_id: str) -> bool:
    try:
        return series.has_series(experiment_id)
    except MutatorError:  # the index is damaged
        return True


def _list_data_alone(
    data: ExperimentListData, run: ReportedRun, embedded: EmbeddedSeries, alone: Mapping[str, Any]
) -> ExperimentListData:
    series = data.facts["series"] | {"packed": False, "kept": [], "alone": alone}
    path = run.folder.path
    media = media_by_experiment(run.folder, path / REPORT_FOLDER, MOST_EMBEDDED_STILL_BYTES)
    scripts = {
        "media": packed_script_element(_media_inside(media), "media"),
        EMBEDDED_SERIES_ELEMENT: json_script_element(embedded.as_json(), EMBEDDED_SERIES_ELEMENT),
    }
    return replace(
        data,
        facts={**data.facts, "series": series, "filmed": False},  # commands for films need the run folder
        script_by_id={**data.script_by_id, **{name: Markup(text) for name, text in scripts.items()}},
    )


def _media_inside(media: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the stills that are embedded, without the links to other files."""
    stills_by_experiment = {
        name: [still for still in files["stills"] if still[1].startswith("data:")]
        for name, files in media.items()
    }
    return {name: {"stills": stills, "films": []} for name, stills in stills_by_experiment.items() if stills}


def _describe_replays(embedded: EmbeddedSeries, last_rank: int, *, is_cut: bool) -> str:
    count = counted(len(embedded), "experiment")
    if not is_cut:
        return f"This file contains the replays of all experiments that have one: {count}."
    return (
        f"This file contains the replays of the worst experiments, up to rank {last_rank:,}: {count}. "
        f"{_limit_text()} Search `rank>{last_rank}` to list the others."
    )


def _describe_limit(last_rank: int) -> str:
    return (
        f"This file contains the replays of the worst experiments only, up to rank {last_rank:,}. "
        f"{_limit_text()} The report in the run folder, report/index.html, has the others that the run kept."
    )


def _limit_text() -> str:
    return f"Replays fill at most {MOST_EMBEDDED_SERIES_BYTES / 1e6:g} MB of it."
