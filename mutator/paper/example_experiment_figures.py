"""Draws figures of single experiments, found by a query over the results and confirmed in the traces."""

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.execution.run_traces import RunTraces
from mutator.figures.drawings import Drawing
from mutator.figures.golden_and_faulty_plot import event_marks
from mutator.outcomes.series_sampling import MOST_SAMPLES_PER_S
from mutator.paper.run_pair_plot import plot_run_pair
from mutator.paper.unsafe_action_detection import ACTION_FIGURES, ActionFigure, RunPair
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd

QUERY_LABEL = "Query over results.csv"
MOST_EXAMINED_CANDIDATES = 5  # candidates for each figure; examining one means unpacking two series


def build_example_drawings(
    folder: RunFolder,
    frame: "pd.DataFrame",
    workspace: Workspace | None,
    figures: Sequence[ActionFigure] = ACTION_FIGURES,
) -> tuple[Drawing, ...]:
    """Return a drawing for each wanted figure. If a figure cannot be drawn, its drawing gives the reason.

    `frame` comes from `statistics.results_frame.load_usable_results`. Traces come from stored series, so
    nothing is rerun.
    """
    traces = RunTraces(workspace, folder) if workspace else None
    drawings = []
    for figure in figures:
        try:
            drawings.append(_build_drawing(frame, traces, figure))
        except MutatorError as err:
            drawings.append(_empty_drawing(figure, f"the traces are not available: {err.got}"))
    return tuple(drawings)


def candidate_rows(frame: "pd.DataFrame", figure: ActionFigure) -> "pd.DataFrame":
    """Return the rows that the query finds, in the order in which they are examined.

    Empty if the target lacks the hazard or channel.
    """
    import pandas as pd

    try:
        matches = frame.query(figure.query, engine="python")
    except pd.errors.UndefinedVariableError:
        return frame.iloc[:0]
    if figure.order_column not in frame:
        return frame.iloc[:0]
    # ids decide ties, so that every machine draws the same figures
    return matches.sort_values([figure.order_column, "experiment_id"], ascending=[False, True])


def _build_drawing(frame: "pd.DataFrame", traces: RunTraces | None, figure: ActionFigure) -> Drawing:
    rows = candidate_rows(frame, figure)
    if rows.empty:
        return _empty_drawing(figure, "no experiment of this run matches the query")
    if traces is None:
        return _empty_drawing(figure, "no fault library was found, so the channels are unknown")
    manifest = traces.manifest
    recorded = {channel.name for channel in (*manifest.compared_channels, *manifest.non_actuator_channels)}
    if missing := [name for name in figure.action_channels if name not in recorded]:
        return _empty_drawing(figure, f"the target records no {missing[0]}")
    faults = plan_file.load_faults(traces.folder.path)
    examined = rows.head(MOST_EXAMINED_CANDIDATES).to_dict("records")
    for rank, row in enumerate(examined, start=1):
        record = traces.record(row["experiment_id"])
        golden, faulty = traces.sampled_traces_of(record.experiment_id)
        step_s = max(manifest.step_s, 1.0 / MOST_SAMPLES_PER_S)
        pair = RunPair.of(golden, faulty, record, manifest.time_channel, step_s, figure.hazard)
        steps = figure.find_steps(pair)
        if steps is not None:
            return Drawing(
                name=figure.name,
                title=figure.title,
                note=_describe_example(figure, row, faults[row["fault_id"]].label, rank, len(rows)),
                figure=plot_run_pair(pair, steps, figure, event_marks(record), manifest),
                described_code_lines=(
                    (QUERY_LABEL, figure.query),
                    (
                        "The whole experiment (DIR: this run folder)",
                        f"mutator show {record.experiment_id} --run DIR",
                    ),
                ),
            )
    return _empty_drawing(
        figure,
        f"the query finds {counted(len(rows), 'experiment')}; examined: {len(examined)}; none shows it",
    )


def _empty_drawing(figure: ActionFigure, reason: str) -> Drawing:
    return Drawing(
        name=figure.name,
        title=figure.title,
        note=f"No figure: {reason}.",
        figure=None,
        described_code_lines=((QUERY_LABEL, figure.query),),
    )


def _describe_example(
    figure: ActionFigure, row: Mapping[Hashable, Any], fault_label: str, rank: int, match_count: int
) -> str:
    return (
        f"{fault_label} in {row['scenario']}, {row['method']}, trigger "
        f"{row['trigger']}: experiment {row['experiment_id']}. "
        f"The query finds {counted(match_count, 'experiment')}. "
        f"Sorted by {figure.order_column}, largest first, this is number {rank}, and the first (of at most "
        f"{MOST_EXAMINED_CANDIDATES} examined) whose traces show that {figure.what_it_shows}."
    )
