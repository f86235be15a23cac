"""All tables of a run: chosen by what its results can tell, written as CSV and Markdown."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from mutator._common.files import write_atomic
from mutator.errors import MutatorError
from mutator.outcomes.golden import load_trace
from mutator.paper import published_tables as paper_tables
from mutator.paper.published import Paper, has_paper, load_paper
from mutator.statistics import compare_tables, time_tables
from mutator.statistics.compare import GUIDED, RANDOM
from mutator.statistics.frame import load
from mutator.statistics.sheet import Sheet
from mutator.statistics.tally import by_kind, by_scenario
from mutator.statistics.times import Alerts
from mutator.store.records import read_records
from mutator.store.run_folder import RunFolder, golden_key
from mutator.workspace import Workspace

FOLDER = "tables"
_DRIVER_S = 1.8  # a driver's reaction to a warning that is seen, where no published numbers say another


def run_sheets(folder: RunFolder, workspace: Workspace | None) -> tuple[Sheet, ...]:
    """The tables of a run whose results.csv is up to date.

    None when they would say no more than counts do: neither both methods nor published fault types. The
    published numbers come from the library of `workspace`; without one ours stand alone.
    """
    frame = load(folder.path / "results.csv")
    references = workspace.library / "references" if workspace else None
    paper = load_paper(references) if references and has_paper(references) else None
    if paper and not {kind for _, kind in paper.coverage} & set(frame["kind"]):
        paper = None
    if not paper and not {GUIDED, RANDOM} <= set(frame["method"]):
        return ()
    alerts = {name: record.alerts for name, record in read_records(folder.path).items()}
    return sheets(frame, paper, alerts, run_ends(folder, workspace) if workspace else None)


def sheets(
    frame: pd.DataFrame, paper: Paper | None, alerts: Alerts, ends: Mapping[str, float] | None
) -> tuple[Sheet, ...]:
    """The tables of a frame. `alerts` of each run are needed to tell which came before a hazard, `ends` (s of
    simulation at which a run of each scenario ends) for censored times; without them these are left out."""
    scenarios, kinds = by_scenario(frame), by_kind(frame)
    methods = sorted({method for method, _ in scenarios})
    made = [paper_tables.summary_sheet(method, scenarios, paper) for method in methods]
    made += [paper_tables.coverage_sheet(method, kinds, paper) for method in methods]
    if {GUIDED, RANDOM} <= set(methods):
        made += [
            compare_tables.overall_sheet(frame, paper),
            compare_tables.kinds_sheet(frame, paper),
            compare_tables.pairs_sheet(frame),
        ]
    made.append(time_tables.propagation_sheet(frame, paper))
    if ends is not None:
        made.append(time_tables.reaction_sheet(frame, ends, paper.driver_reaction_s if paper else _DRIVER_S))
    if alerts.keys() >= set(frame["experiment_id"]):
        made.append(time_tables.alerts_sheet(frame, alerts))
    made.append(time_tables.orders_sheet(frame))
    return tuple(sheet for sheet in made if sheet.lines)


def write(made: Sequence[Sheet], out: Path) -> None:
    """Write each table into `out`/tables as <name>.csv and <name>.md."""
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for sheet in made:
        write_atomic(folder / f"{sheet.name}.csv", sheet.csv().encode())
        write_atomic(folder / f"{sheet.name}.md", sheet.markdown().encode())


def run_ends(folder: RunFolder, workspace: Workspace) -> dict[str, float] | None:
    """When the fault-free runs of each scenario end; None when they cannot be read (any more)."""
    ends: dict[str, float] = {}
    try:
        manifest = workspace.manifest(folder.head["target"])
        for scenario, changes in folder.head["goldens"]:
            trace = load_trace(manifest, folder.path / "golden" / golden_key(scenario, changes), [])
            end = float(trace[manifest.time_channel][-1])
            ends[scenario] = max(end, ends.get(scenario, end))
    except (MutatorError, KeyError):
        return None
    return ends
