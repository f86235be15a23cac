"""Draws figures of single experiments, found by a query over the results and confirmed in the traces."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import pandas as pd

from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.execution.run_traces import Traces
from mutator.figures.drawings import Drawing
from mutator.figures.run_plot import marks_of
from mutator.outcomes.series_sampling import RATE
from mutator.paper.run_pair_plot import draw
from mutator.paper.unsafe_actions import WANTED, Pair, Wanted
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

QUERY = "Query over results.csv"
LOOKED_AT = 5  # maximum number of candidates examined for each figure


def example_drawings(
    folder: RunFolder,
    frame: pd.DataFrame,
    workspace: Workspace | None,
    wanted: Sequence[Wanted] = WANTED,
) -> tuple[Drawing, ...]:
    """Return a drawing for each wanted figure. If a figure cannot be drawn, its drawing gives the reason.

    `frame` comes from `statistics.results_frame.load_usable_results`. Traces come from stored series, so
    nothing is rerun.
    """
    traces = Traces(workspace, folder) if workspace else None
    made = []
    for one in wanted:
        try:
            made.append(_drawing(frame, traces, one))
        except MutatorError as err:
            made.append(_none(one, f"the traces are not available: {err.got}"))
    return tuple(made)


def candidates(frame: pd.DataFrame, wanted: Wanted) -> pd.DataFrame:
    """Return the rows that the query finds, in the order in which they are examined.

    Empty if the target lacks the hazard or channel.
    """
    try:
        found = frame.query(wanted.query, engine="python")
    except pd.errors.UndefinedVariableError:
        return frame.iloc[:0]
    if wanted.order not in frame:
        return frame.iloc[:0]
    return found.sort_values([wanted.order, "experiment_id"], ascending=[False, True])


def _drawing(frame: pd.DataFrame, traces: Traces | None, wanted: Wanted) -> Drawing:
    found = candidates(frame, wanted)
    if found.empty:
        return _none(wanted, "no experiment of this run matches the query")
    if traces is None:
        return _none(wanted, "no fault library was found, so the channels are unknown")
    manifest = traces.manifest
    recorded = {channel.name for channel in (*manifest.compared, *manifest.plotted)}
    if missing := [name for name in wanted.actions if name not in recorded]:
        return _none(wanted, f"the target records no {missing[0]}")
    faults = plan_file.read_faults(traces.folder.path)
    looked_at = found.head(LOOKED_AT).to_dict("records")
    for number, row in enumerate(looked_at, start=1):
        record = traces.record(row["experiment_id"])
        golden, faulty = traces.sampled(record.experiment_id)
        step_s = max(manifest.step_s, 1.0 / RATE)
        pair = Pair.of(golden, faulty, record, manifest.time_channel, step_s, wanted.hazard)
        steps = wanted.look(pair)
        if steps is not None:
            return Drawing(
                name=wanted.name,
                title=wanted.title,
                note=_note(wanted, row, faults[row["fault_id"]].label, number, len(found)),
                figure=draw(pair, steps, wanted, marks_of(record), manifest),
                codes=(
                    (QUERY, wanted.query),
                    (
                        "The whole experiment (DIR: this run folder)",
                        f"mutator show {record.experiment_id} --run DIR",
                    ),
                ),
            )
    return _none(
        wanted,
        f"the query finds {counted(len(found), 'experiment')}; examined: {len(looked_at)}; none shows it",
    )


def _none(wanted: Wanted, why: str) -> Drawing:
    return Drawing(
        name=wanted.name,
        title=wanted.title,
        note=f"No figure: {why}.",
        figure=None,
        codes=((QUERY, wanted.query),),
    )


def _note(wanted: Wanted, row: Mapping[Hashable, Any], fault: str, number: int, of: int) -> str:
    return (
        f"{fault} in {row['scenario']}, {row['method']}, trigger "
        f"{row['trigger']}: experiment {row['experiment_id']}. The query finds {counted(of, 'experiment')}. "
        f"Sorted by {wanted.order}, largest first, this is number {number}, and the first (of at most "
        f"{LOOKED_AT} examined) whose traces show that {wanted.confirmed}."
    )
