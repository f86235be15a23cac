"""Pages with the drives of golden runs that failed their check, because such a campaign has no report."""

import math
from collections.abc import Iterable
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import make_folder, write_atomic
from mutator.errors import CheckFailed, MutatorError
from mutator.outcomes.hazard_and_metric_judgement import RunJudgement, load_judged_run
from mutator.outcomes.trace_and_record_loading import Trace, values_on_steps
from mutator.store.preflight_results import check_results
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.overhead_view_json import scene_as_json
from mutator.targets.stored_target_facts import channel_facts, hazard_facts
from mutator.web import asset_text, load_order, packed_script_element
from mutator.workspace import Workspace

REPORT_FOLDER = "report"


def with_golden_run_pages(error: CheckFailed, run: Path, workspace: Workspace) -> CheckFailed:
    """Return the error of a campaign that did not start, which names the pages of its failed golden runs.

    The pages are written. Without a golden run that failed and left a trace, the error is returned unchanged.
    """
    try:
        pages = write_golden_run_pages(RunFolder.open(run), workspace)
    except MutatorError:
        return error
    if not pages:
        return error
    return CheckFailed(
        error.got,
        where=error.where,
        expected=error.expected,
        remedy=f"look at the drive: {' and '.join(map(str, pages))}; then {error.remedy}",
    )


def write_golden_run_pages(folder: RunFolder, workspace: Workspace) -> list[Path]:
    """Write a page for each golden run whose check failed, unless it left no trace. Return their paths."""
    manifest = workspace.manifest_of(folder.head)
    failed = {check.name: check.detail for check in check_results(folder) if not check.passed}
    pages = []
    for golden_run in folder.goldens_with_files:
        detail = failed.get(f"golden {golden_run.key}")
        if detail is None:
            continue
        try:
            trace, judged = load_judged_run(manifest, folder.golden_folder(*golden_run))
        except MutatorError:  # it crashed
            continue
        page = path_below(folder.path / REPORT_FOLDER, f"golden-{golden_run.key}.html")
        make_folder(page.parent)
        text = _page_html(golden_run.key, detail, _drive_as_json(golden_run.key, manifest, trace, judged))
        write_atomic(page, text.encode())
        pages.append(page)
    return pages


def _drive_as_json(name: str, manifest: TargetManifest, trace: Trace, judged: RunJudgement) -> dict[str, Any]:
    """Return the data that web/golden/golden.js shows."""
    time = trace[manifest.time_channel]
    marks = [
        *(("hazard", time_s, hazard) for hazard, time_s in judged.hazards),
        *(("alert", time_s, alert) for alert, time_s in judged.alerts),
    ]
    channels = [
        {
            "name": channel.name,
            "unit": channel.unit,
            "role": channel.role.value,
            "about": channel.about,
            "values": _json_numbers(values_on_steps(trace, channel.name, time).astype(float).tolist()),
        }
        for channel in channel_facts(manifest)
        if channel.name in trace
    ]
    return {
        "name": name,
        "t": [float(step) for step in time],
        "tEnd": judged.t_end,
        "marks": sorted(marks, key=lambda mark: mark[1]),
        "channels": channels,
        "scene": scene_as_json(manifest),
        "hazards": [asdict(hazard) for hazard in hazard_facts(manifest)],
    }


def _json_numbers(values: Iterable[float]) -> list[float | str | None]:
    """Return numbers for JSON: NaN is null, and an infinity is a text that JavaScript reads as one."""
    return [
        value if math.isfinite(value) else None if math.isnan(value) else f"{'-' * (value < 0)}Infinity"
        for value in values
    ]


def _page_html(name: str, detail: str, drive: dict[str, Any]) -> str:
    style = "".join(map(asset_text, load_order("golden", ".css")))
    script = "".join(map(asset_text, load_order("golden", ".js")))
    title = f"Golden run {escape(name)}"
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title} - mutator</title>\n<style>{style}</style></head>\n<body><main>\n"
        f"<h1>{title}</h1>\n<p>This run without a fault failed its check: {escape(detail)}.\n"
        "So the campaign has no results. The replay draws it twice, as golden and as faulty.</p>\n"
        '<div id="replay"></div>\n'
        f"</main>\n{packed_script_element(drive, 'drive')}\n<script>{script}</script></body></html>\n"
    )
