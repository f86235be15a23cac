"""The data of each experiment on the report's page: results as columns, fault, trigger and diff."""

import base64
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from markupsafe import Markup

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import as_json_types
from mutator.config.location_syntax import location_as_yaml
from mutator.model import Experiment, Fault
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.report.answer_parts import warning_filter_values
from mutator.report.experiment_facts import RANK_COLUMN, UNTIMED_PATH_COLUMN
from mutator.report.fault_path_page_data import RunFaultPaths
from mutator.report.first_screen_facts import worst_record
from mutator.report.heat_map_data import build_heat_map
from mutator.report.panel import REPORT_FOLDER
from mutator.report.report_glossary import code_meanings_by_column
from mutator.report.reported_run import ReportedRun, manifest_if_any
from mutator.report.reported_sets import list_columns, page_details, page_facts
from mutator.report.series_for_report_page import series_facts_for_page
from mutator.report.source_lines_with_outcomes import SourceLines
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.outcome_counting import (
    checked_hazard_names,
    families_or_scenarios_of,
    fault_types_of,
    first_hazard_times,
    joined_occurred_hazards,
    outcome_or_status_of_rows,
)
from mutator.results.result_rows import ResultRow, rows_of
from mutator.review.patch_shapes import PatchShape, shapes_of_patches
from mutator.statistics.mutation_score import PERMANENT, TRANSIENT
from mutator.statistics.sheet_selection import DEFAULT_DRIVER_REACTION_S
from mutator.store.embedded_series import EMBEDDED_SERIES_ELEMENT, embed_worst
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.targets.overhead_view_json import scene_as_json
from mutator.triggers.trigger_kinds import ALWAYS_NAME
from mutator.web import json_script_element, packed_script_element

if TYPE_CHECKING:
    from pandas import DataFrame

    from mutator.workspace import Workspace

TABLE_SCHEMA = "report-table/1"
LIST_SORT_COLUMNS = ["module", "fault_type", "scenario", "method", "trigger", "experiment_id"]
DETAILS_SCHEMA = "report-details/1"
_ALERT_COLUMNS = ("alerts", "t_alert", "reaction_time")  # columns that need a target with alerts
MOST_EMBEDDED_STILL_BYTES = 1_000_000  # limit of the stills embedded in the page; the others become links
_TRACE_DIGEST_DIGITS = 16  # enough to notice another trace; whole digests would be four times as long
_MOST_BYTES_OF_FIRST_REPLAY = 500_000  # about 7 kB are usual; a larger series is read from its file
MOST_LISTED_EXPERIMENTS = 50_000  # that the page lists, so that it opens quickly
_MOST_LISTED_OF_EXPLORATION = 8_000  # these are less alike, and pictures need room, too


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentListData:
    """Data for the page's scripts: `facts`, and the script elements with the rest, by id. `truncation_note`
    says which experiments the page lists; '' if all.
    """

    facts: Mapping[str, Any]
    script_by_id: Mapping[str, Markup]
    truncation_note: str = ""

    @property
    def facts_element(self) -> Markup:
        return Markup(json_script_element(self.facts, "facts"))


def build_list_data(run: ReportedRun) -> ExperimentListData:
    """Return the page data of a run. Paths in it are relative to the report's folder."""
    folder, workspace = run.folder, run.workspace
    listed = _listed_results(run)
    ids = listed["experiment_id"].tolist()
    data: dict[str, Any] = {"table": _list_table_data(run, listed), "details": _list_details_data(run, ids)}
    data["media"] = media_by_experiment(folder, folder.path / REPORT_FOLDER, MOST_EMBEDDED_STILL_BYTES)
    if run.run_fault_paths:
        data["paths"] = run.run_fault_paths.page_data(ids)
    if sets := run.defended_sets():
        data["defended"] = page_details(sets, ids)
    facts = {
        **({"defences": page_facts(sets)} if sets else {}),
        **_film_and_scene_facts(folder, workspace),
        "series": series_facts_for_page(folder),
        "metrics": folder.head.metrics,
        "has_rates": run.has_rates,
        "severity": as_json_types(folder.head.severity),
        "hazards": as_json_types(folder.head.about_hazards),
        "meanings": code_meanings_by_column(run),
        "reaction_s": DEFAULT_DRIVER_REACTION_S,
    }
    worst_facts, worst_scripts = first_replay_data(run)
    scripts = {name: Markup(packed_script_element(value, name)) for name, value in data.items()}
    return ExperimentListData(
        facts={**facts, **worst_facts},
        script_by_id=scripts | worst_scripts,
        truncation_note=_describe_truncation(run),
    )


def first_replay_data(run: ReportedRun) -> tuple[dict[str, Any], dict[str, Markup]]:
    """Return facts and script elements for the replay of the worst experiment, which the page contains; empty
    without one.
    """
    worst = worst_record(run)
    if worst is None:
        return {}, {}
    embedded, _ = embed_worst(TimeSeriesFolder(run.folder.path), [worst], _MOST_BYTES_OF_FIRST_REPLAY)
    element = json_script_element(embedded.as_json(), EMBEDDED_SERIES_ELEMENT)
    facts = {"worst": {"id": worst.experiment_id, "trace": worst.trace_digest[:_TRACE_DIGEST_DIGITS]}}
    return facts, {EMBEDDED_SERIES_ELEMENT: Markup(element)} if embedded else {}


def most_listed_experiments(run: ReportedRun) -> int:
    """Return how many of the worst experiments of a run the page lists. It also lists those that it links."""
    return (
        min(MOST_LISTED_EXPERIMENTS, _MOST_LISTED_OF_EXPLORATION) if run.explored else MOST_LISTED_EXPERIMENTS
    )


def _describe_truncation(run: ReportedRun) -> str:
    count, path, most = len(run.results), run.folder.path.name, most_listed_experiments(run)
    if count <= most:
        return ""
    linked = ", and those with links above," if run.explored else ""
    return (
        f"The list has the {most:,} worst{linked} of {count:,} experiments (by rank). All other "
        "parts of this page cover all experiments. To see another experiment: "
        f"`mutator show ID --run {path}`. To list the worst that match a filter: "
        f"`mutator show --run {path} --only 'FILTER'`. All experiments are in results.parquet."
    )


def _film_and_scene_facts(folder: RunFolder, workspace: "Workspace | None") -> dict[str, Any]:
    """Whether films can be made (true without a manifest), and the scene for the replay."""
    manifest = manifest_if_any(folder, workspace)
    filmed = manifest is None or manifest.film is not None
    return {"filmed": filmed, "scene": scene_as_json(manifest) if manifest else None}


def _listed_results(run: ReportedRun) -> "DataFrame":
    """Return the results that the page lists, in reading order, with rank and path."""
    is_listed = run.experiment_facts.worst_first_ranks < most_listed_experiments(run)
    if run.explored:
        is_listed |= run.results["experiment_id"].isin(run.explored.linked_ids).to_numpy()
    extra_columns = {
        RANK_COLUMN: run.experiment_facts.worst_first_ranks[is_listed],
        UNTIMED_PATH_COLUMN: run.experiment_facts.untimed_path_indices[is_listed],
    }
    return run.results[is_listed].assign(**extra_columns).sort_values(LIST_SORT_COLUMNS)


def _list_table_data(run: ReportedRun, listed: "DataFrame") -> dict[str, Any]:
    data = results_table_data(
        listed,
        run.faults,
        run.run_fault_paths,
        has_alerts=run.folder.has_alerts,
        source=run.source_lines,
        sentences=ExperimentSentences.of_run(run.folder.head),
        more_columns=list_columns(run.defended_sets(), listed["experiment_id"].tolist()),
    )
    if scale := run.folder.severity_scale:
        data["severities"] = scale.labels
    if len(listed) < len(run.results):
        data |= {"of": len(run.results), "map": build_heat_map(run)}
    return data


def _list_details_data(run: ReportedRun, ids: Sequence[str]) -> dict[str, Any]:
    records = map(run.records.get, ids)
    traces = [record.trace_digest[:_TRACE_DIGEST_DIGITS] if record else "" for record in records]
    return details_data(
        list(map(run.experiments.get, ids)), shapes_of_patches(_readable_patches(run, ids)), ids, traces
    )


def results_table_data(
    results: "DataFrame",
    faults: Mapping[str, Fault],
    paths: RunFaultPaths | None = None,
    *,
    has_alerts: bool = True,
    source: SourceLines | None = None,
    sentences: ExperimentSentences | None = None,
    more_columns: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, Any]:
    """Return the results by column, with derived columns such as `rank` (1: the worst). In `scenario`, those
    of a family have its name, so that filters and maps count them as one. Alert columns need a
    target with `alerts`; `line` (of the fault) and `lasting` need a `source`. `faults` are those of the plan.
    """
    omitted_columns = {RANK_COLUMN, UNTIMED_PATH_COLUMN, *(() if has_alerts else _ALERT_COLUMNS)}
    columns: dict[str, Iterable[Any]] = {
        str(name): results[name] for name in results.columns if name not in omitted_columns
    }
    columns["kind"] = fault_types_of(results)
    if families := results.attrs.get("families"):
        columns |= {"scenario": families_or_scenarios_of(results), "concrete_scenario": results["scenario"]}
    rows = rows_of(results, faults, sentences)
    columns["sentence"] = [row.sentence for row in rows]
    columns["fault"] = [row.fault for row in rows]
    columns["ending"] = outcome_or_status_of_rows(results)
    columns["hazards"] = joined_occurred_hazards(results)
    if has_alerts:
        columns["warning"] = warning_filter_values(results)
    columns["rank"] = results[RANK_COLUMN] + 1
    columns["t_hazard"] = first_hazard_times(results).min(axis=1)
    if paths:
        columns["through"] = paths.joined_passed_links(results[UNTIMED_PATH_COLUMN])
    if source:
        columns |= _operator_columns(source, results, rows)
    columns |= more_columns or {}
    columns_data = [{"name": name, **column_data(name, values)} for name, values in columns.items()]
    labels = {name: facts["label"] for name, facts in paths.components.items()} if paths else {}
    checked_hazards = list(checked_hazard_names(results))
    return {
        "schema": TABLE_SCHEMA,
        "count": len(results),
        "checked": checked_hazards,
        "labels": labels,
        **({"families": as_json_types(families)} if families else {}),
        "columns": columns_data,
    }


def _operator_columns(
    source: SourceLines, results: "DataFrame", rows: Sequence[ResultRow]
) -> dict[str, list[str]]:
    """Return the columns that differ for mutants of operators. Their `value` is the change in the source."""
    faults = results["fault_id"].tolist()
    changes = [source.change_by_fault.get(name, "") for name in faults]
    rows_and_changes = list(zip(rows, changes, strict=True))
    return {
        "value": [
            change or ("" if row.value is None else str(row.value)) for row, change in rows_and_changes
        ],
        "variant": [
            row.variant.removesuffix(f" {change}" if change else "") for row, change in rows_and_changes
        ],
        "line": [source.path_and_line_by_fault.get(name, "") for name in faults],
        "lasting": [PERMANENT if row.trigger == ALWAYS_NAME else TRANSIENT for row in rows],
    }


def column_data(name: str, values: Iterable[Any]) -> dict[str, Any]:
    """Return a column's data: numbers (None: no value), ids as texts, otherwise codes of the distinct
    texts.
    """
    cells = list(values)
    if any(not isinstance(cell, str) for cell in cells):
        numbers = list(map(_json_number, cells))
        if any(number is not None for number in numbers):
            return {"numbers": numbers}
        cells = [""] * len(cells)
    if name in ("experiment_id", "sentence"):  # nearly all are distinct, so codes would save nothing
        return {"texts": cells}
    words = sorted(set(cells))
    code = {word: i for i, word in enumerate(words)}
    return {"words": words, "codes": [code[text] for text in cells]}


def _json_number(value: float) -> float | int | str | None:
    """Return the value for JSON, which has no infinities; None for NaN."""
    if math.isnan(value):
        return None
    if math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    # JSON as numbers of JavaScript: whole numbers are exact up to 2**53
    return int(value) if abs(value) < 2**53 and value == int(value) else float(value)


def details_data(
    experiments: Sequence[Experiment | None],
    diff_shapes: Sequence[PatchShape],
    ids: Sequence[str],
    trace_digests: list[str],
) -> dict[str, Any]:
    """For each of the `ids`, the codes of its spec and trigger setting (-1: not in the plan), the index of
    its diff's shape (-1: no diff), and the start of its trace's digest, which its series must name. A shape
    has a list of values for each hole in its text, in row order.
    """
    specs, settings = _TextCodes(), _TextCodes()
    faults = {e.fault.id: e.fault for e in experiments if e}
    spec = {name: _spec_yaml(fault) for name, fault in faults.items()}
    shape_of = {member: i for i, shape in enumerate(diff_shapes) for member in shape.member_ids}
    return {
        "schema": DETAILS_SCHEMA,
        "spec": [specs.code_of(spec[e.fault.id]) if e else -1 for e in experiments],
        "setting": [settings.code_of(_trigger_setting_json(e)) if e else -1 for e in experiments],
        "shape": [shape_of.get(name, -1) for name in ids],
        "trace": trace_digests,
        "specs": specs.texts,
        "settings": [json.loads(text) for text in settings.texts],
        "shapes": [
            {
                "parts": s.parts,
                "places": s.hole_indices,
                "values": list(zip(*s.values_by_member, strict=True)),
            }
            for s in diff_shapes
        ],
    }


class _TextCodes:
    def __init__(self) -> None:
        self._codes: dict[str, int] = {}

    def code_of(self, text: str) -> int:
        return self._codes.setdefault(text, len(self._codes))

    @property
    def texts(self) -> list[str]:
        return list(self._codes)


def _spec_yaml(fault: Fault) -> str:
    """Return the fault with its drawn value, as a spec in YAML."""
    spec = {name: value for name, value in as_json_types(fault).items() if value not in (None, [], "")}
    spec["injections"] = [
        {
            "at": location_as_yaml(i.location),
            "model": i.model,
            "params": dict(i.params),
            **{name: getattr(i, name) for name in ("where", "call", "every") if getattr(i, name) is not None},
        }
        for i in fault.injections
    ]
    return yaml.safe_dump(spec, sort_keys=False, allow_unicode=True, width=100)


def _trigger_setting_json(experiment: Experiment) -> str:
    trigger = asdict(experiment.trigger)
    hold = experiment.fault.hold or experiment.trigger.hold
    times = {name: trigger[name] for name in ("hold_s", "armed_after_s")}
    return json.dumps({"hold": hold.value, **times, "changes": experiment.changes})


def _readable_patches(run: ReportedRun, ids: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield each experiment's id, an empty grouping key, and the patch without the probe."""
    for name in ids:
        data = run.folder.read_patch(name, run.records.get(name))
        if data is not None:
            yield name, "", patch_without_new_files(data.decode("utf-8", "replace"))[0]


def media_by_experiment(
    folder: RunFolder, page_folder: Path, most_embedded_bytes: int
) -> dict[str, dict[str, Any]]:
    """Return the stills, films and exact plots in plots/, by experiment. Stills are embedded up to
    `most_embedded_bytes` in total; the rest become links relative to `page_folder`.
    """
    files_by_experiment: dict[str, dict[str, Any]] = {}
    plot_files = filter(Path.is_file, (folder.path / "plots").glob("*"))
    for path in sorted(plot_files, key=lambda p: (len(p.name), p.name)):
        name, _, time = path.stem.partition("-")
        link = Path(os.path.relpath(path, page_folder)).as_posix()
        media_of_experiment = files_by_experiment.setdefault(name, {"stills": [], "films": []})
        if path.suffix in (".mp4", ".gif"):
            media_of_experiment["films"].append(link)
        elif path.suffix == ".svg" and not time:
            media_of_experiment["plot"] = link
        elif path.suffix in (".jpg", ".png") and time:
            size = path.stat().st_size
            if size <= most_embedded_bytes:
                most_embedded_bytes -= size
                kind = "jpeg" if path.suffix == ".jpg" else "png"
                link = f"data:image/{kind};base64,{base64.b64encode(read_bounded(path)).decode()}"
            media_of_experiment["stills"].append([time.removesuffix("s"), link])
    return {name: files for name, files in files_by_experiment.items() if any(files.values())}
