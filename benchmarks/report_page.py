"""Measure the size and opening time of the report's page for 1,000, 11,280 and 100,000 experiments.

`python benchmarks/report_page.py [--json FILE]`. The experiments are those of the paper's campaign, with more
seeds if needed. Their records are synthetic. The page opens in a headless Chromium. Times are wall times in
the browser, the best of several: until the table is usable, then for the first filter, sort, search and
opened experiment. Goal: 11,280 experiments open within a second and take at most 8 MB.
"""

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from growth import record
from markupsafe import Markup

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Experiment, Record, Trigger
from mutator.mutants.mutant_building import build
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.report import experiment_list_data as report_browse
from mutator.report import report_markdown_and_html as report_page
from mutator.report.experiment_facts import RANK_COLUMN, UNTIMED_PATH_COLUMN
from mutator.report.experiment_list_data import ExperimentListData
from mutator.report.panels.answers_panel import build_answers_panel
from mutator.report.panels.fault_paths_panel import build_fault_paths_panel
from mutator.report.panels.first_screen_panel import build_first_screen_panel
from mutator.report.report_glossary import glossary_of
from mutator.report.report_markdown_and_html import ReportContent
from mutator.report.reported_run import ReportedRun
from mutator.results import table_building
from mutator.results.outcome_counting import count_by_outcome_or_status
from mutator.review.patch_shapes import shapes_of_patches
from mutator.store.checksummed_lines import LineWriter
from mutator.store.embedded_series import EMBEDDED_SERIES_ELEMENT, EmbeddedSeries
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import encode_series
from mutator.store.series_packing import EncodedSeries, SeriesWriter, pack_series
from mutator.store.time_series_folder import TimeSeriesFolder
from mutator.targets.overhead_view_json import scene_as_json
from mutator.web import json_script_element, packed_script_element
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[1]
SIZES = (1_000, 11_280, 100_000)
GOAL_SIZE, GOAL_MS, GOAL_KB = 11_280, 1_000.0, 8_000.0
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
WATCH = """new MutationObserver(() => {
    if (document.documentElement?.dataset.ready) window.readyAt ??= performance.now();
}).observe(document, {attributes: true, subtree: true, attributeFilter: ["data-ready"]})"""
SHOWN = "await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
TIMED = f"""async () => {{
    const began = performance.now();
    STEP;
    {SHOWN};
    return performance.now() - began;
}}"""
CLEARED = f"async () => {{ document.querySelector('#chips .clear, #chips .chip')?.click(); {SHOWN} }}"
SERIES = 48  # different series
STEPS = {  # a reader's first actions
    "filter": "document.querySelector('#heat .cell:not(.nothing)').click()",
    "sort": "document.querySelector('[data-column=t_hazard] button').click()",
    "search": "const s = document.querySelector('#search'); s.value = 'chaff 35';"
    " s.dispatchEvent(new Event('input')); await new Promise((done) => setTimeout(done, 120))",
    "experiment": "document.querySelector('#grid tr[data-at]').click();"
    " while (!document.querySelector('#experiment .replay :is(.plot, canvas)'))"
    " await new Promise((done) => setTimeout(done, 1))",
}


def written_run(workspace: Workspace, size: int, out: Path) -> list[Experiment]:
    """Write a run folder with results of synthetic records and return its experiments."""
    plan = build_plan(workspace, "paper")
    known = plan.experiments
    experiments = [replace(known[i % len(known)], seed=1 + i // len(known)) for i in range(size)]
    freeze_plan(replace(plan, experiments=tuple(experiments), chunks=(size,)), out, workspace)
    lines = LineWriter(out / "records" / "0001-main.jsonl", {"schema": RECORDS_SCHEMA, "plan": plan.digest})
    draw = np.random.default_rng(1)
    names = [metric.name for metric in workspace.manifest("openpilot").all_metrics]
    for number, experiment in enumerate(experiments):
        metrics = tuple(zip(names, map(float, np.abs(draw.normal(10.0, 5.0, len(names)))), strict=True))
        lines.append(asdict(replace(record(experiment, number), metrics=metrics)))
    lines.close()
    table_building.build_tables(out)
    return experiments


def patches(workspace: Workspace, experiments: Sequence[Experiment]) -> Iterator[tuple[str, str, str]]:
    """Yield the diffs without the probe, which are the same for every seed."""
    manifest, models = workspace.manifest("openpilot"), workspace.fault_models()
    known: dict[tuple[str, Trigger], str] = {}
    for experiment in experiments:
        key = (experiment.fault.id, experiment.trigger)
        if key not in known:
            known[key] = patch_without_new_files(
                build(manifest, models, experiment.fault, experiment.trigger).patch
            )[0]
        yield experiment.id, "", known[key]


def write_series(workspace: Workspace, records: Sequence[Record], out: Path) -> float:
    """Write series of realistic lengths, each shared by many records. Return the size of the index in KB."""
    manifest = workspace.manifest("openpilot")
    draw = np.random.default_rng(1)
    names = [channel.name for channel in manifest.channels]
    time = {manifest.time_channel: np.arange(3000) / 100}
    golden = time | {name: draw.normal(size=3000).cumsum().cumsum() for name in names}
    sampler, made = SeriesSampler(manifest, golden), []
    for one in records[:SERIES]:
        change = draw.normal(size=2000).cumsum().cumsum()  # a value per step after the activation
        faulty = golden | {
            name: golden[name] + np.concatenate((np.zeros(1000), change)) for name in names[:7]
        }
        made.append(encode_series(sampler.faulty_series(faulty, one), sampler.golden))
    writer = SeriesWriter(out, "0001-main")
    for number, one in enumerate(records):
        data = EncodedSeries(
            golden_key="S1", golden_bytes=sampler.encoded_golden, faulty_bytes=made[number % len(made)]
        )
        writer.append(one.experiment_id, data)
    writer.close()
    pack_series(out, "plan", {one.experiment_id: number for number, one in enumerate(records)}, 500)
    return (out / "series" / "index.js").stat().st_size / 1000


def worst_series(out: Path, experiment_id: str) -> Markup:
    """Return the element with the series of the worst experiment. A report would leave it out, because it
    does not deviate as the synthetic record says.
    """
    encoded, embedded = TimeSeriesFolder(out).read_encoded(experiment_id), EmbeddedSeries(sys.maxsize)
    assert encoded is not None
    embedded.add({experiment_id: encoded})
    return Markup(json_script_element(embedded.as_json(), EMBEDDED_SERIES_ELEMENT))


def write(size: int, out: Path) -> dict[str, float]:
    """Write the page of that many experiments. Return its time and the size of its parts in KB."""
    workspace = Workspace.find(root=ROOT)
    experiments = {e.id: e for e in written_run(workspace, size, out)}
    began = process_time()
    run = ReportedRun.open(RunFolder.open(out), None)
    more = {
        RANK_COLUMN: run.experiment_facts.worst_first_ranks,
        UNTIMED_PATH_COLUMN: run.experiment_facts.untimed_path_indices,
    }
    table = packed_script_element(
        report_browse.results_table_data(run.results.assign(**more), run.faults, run.run_fault_paths), "table"
    )
    assert run.run_fault_paths is not None
    ids = run.results["experiment_id"].tolist()
    paths = packed_script_element(run.run_fault_paths.page_data(ids), "paths")
    table_s = process_time() - began
    shown = [experiments[name] for name in ids]
    records = [record(e, n) for n, e in enumerate(shown)]
    traces = [one.trace_digest for one in records]
    details = report_browse.details_data(shown, shapes_of_patches(patches(workspace, shown)), ids, traces)
    detail = packed_script_element(details, "details")
    index_kb = write_series(workspace, records, out)
    # no column of deviations: the synthetic records do not state those of the series
    facts = {
        "filmed": True,
        "scene": scene_as_json(workspace.manifest("openpilot")),
        "series": {"packed": True, "kept": [], "deviations": {}},
    }
    scripts = {
        "table": Markup(table),
        "details": Markup(detail),
        "paths": Markup(paths),
        "media": Markup(packed_script_element({}, "media")),
    }
    worst_facts, _ = report_browse.first_replay_data(run)
    scripts[EMBEDDED_SERIES_ELEMENT] = worst_series(out, worst_facts["worst"]["id"])
    browse = ExperimentListData(facts=facts | worst_facts, script_by_id=scripts)
    content = ReportContent(
        title=f"{size} experiments",
        alarm="",
        outcome_counts=count_by_outcome_or_status(run.results),
        plan_text="",
        glossary=glossary_of(run),
        leading_panels=(),
        first_screen=build_first_screen_panel(run),
        answers=build_answers_panel(run),
        panels=[panel for panel in (build_fault_paths_panel(run),) if panel],
        pages=(),
        study=None,
        experiment_list=browse,
    )
    page = report_page.report_html(content)
    (out / "report").mkdir()
    (out / "report" / "index.html").write_text(page)
    sizes = {"page_kb": page, "table_kb": table, "details_kb": detail, "paths_kb": paths}
    kb = {name: len(text.encode()) / 1000 for name, text in sizes.items()}
    return {"table_s": table_s, **kb, "index_kb": index_kb}


def opened(browser: Any, page_file: Path, repeat: int, steps: Mapping[str, str] = STEPS) -> dict[str, float]:
    """Return the best times in ms until the page is ready and for each later step."""
    times: dict[str, list[float]] = {"open_ms": [], **{f"{name}_ms": [] for name in steps}}
    for _ in range(repeat):
        context = browser.new_context(viewport={"width": 1400, "height": 900})
        page = context.new_page()
        page.add_init_script(WATCH)
        page.goto(page_file.as_uri())
        page.wait_for_function("window.readyAt", timeout=120_000)
        times["open_ms"].append(page.evaluate("window.readyAt"))
        for name, step in steps.items():
            times[f"{name}_ms"].append(page.evaluate(TIMED.replace("STEP", step)))
            page.evaluate(CLEARED)
        context.close()
    return {name: min(values) for name, values in times.items()}


def launched(playwright: Any) -> Any:
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit("no Chromium on the PATH")
    flags = [*FLAGS, "--no-sandbox"] if os.geteuid() == 0 else [*FLAGS]
    return playwright.chromium.launch(executable_path=path, args=flags)


def main() -> int:
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    options = parser.parse_args()
    found = {}
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = launched(playwright)
        for size in options.sizes:
            out = Path(folder) / str(size)
            found[size] = write(size, out)
            found[size] |= opened(browser, out / "report" / "index.html", options.repeat)
        browser.close()
    names = list(next(iter(found.values())))
    print("experiments " + " ".join(f"{name:>13}" for name in names))
    for size, figures in found.items():
        print(f"{size:>11,} " + " ".join(f"{figures[name]:13,.1f}" for name in names))
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    goal = found.get(GOAL_SIZE, {"open_ms": 0.0, "page_kb": 0.0})
    missed = goal["open_ms"] > GOAL_MS or goal["page_kb"] > GOAL_KB
    if missed:
        print(f"{GOAL_SIZE} experiments open in over {GOAL_MS / 1000} s or take over {GOAL_KB / 1000} MB")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
