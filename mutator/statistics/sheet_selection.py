"""Select the statistical tables that fit a run's results."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from mutator.statistics import event_time_and_order_tables, guided_against_random_tables, summary_tables
from mutator.statistics.event_time_statistics import FirstAlertsByHazardRun
from mutator.statistics.guided_against_random import GUIDED, RANDOM
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.results_frame import select_common_columns
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.statistics_sheet import Sheet
from mutator.statistics.tallies import tally_by_fault_type, tally_by_scenario

if TYPE_CHECKING:
    import pandas as pd

DEFAULT_DRIVER_REACTION_S = (
    1.8  # a driver's reaction time to a visible warning; used if no publication states one
)


def run_sheets(
    frame: "pd.DataFrame",
    published: PublishedCounts | None,
    first_alerts_by_hazard_run: FirstAlertsByHazardRun | None,
    end_by_scenario: Mapping[str, float] | None,
) -> tuple[Sheet, ...]:
    """Return the tables of a frame. A single method without published counts gets none, because they would
    only repeat counts.

    `alerts_by_experiment` has the alerts of each run with a hazard (None: the target has no alerts); they
    decide which event came first. `end_by_scenario` has the end of each scenario's runs in simulated seconds;
    censored times need it. Tables whose inputs are missing are left out.
    """
    frame = select_common_columns(frame)
    if not published and not {GUIDED, RANDOM} <= set(frame["method"]):
        return ()
    scenarios, kinds = tally_by_scenario(frame), tally_by_fault_type(frame)
    methods = sorted({method for method, _ in scenarios})
    sample = frame if WEIGHT_COLUMN in frame else None
    has_alerts = first_alerts_by_hazard_run is not None
    sheets = [
        summary_tables.summary_sheet(method, scenarios, published, has_alerts=has_alerts, sample=sample)
        for method in methods
    ]
    sheets += [summary_tables.coverage_sheet(method, kinds, published, sample=sample) for method in methods]
    if {GUIDED, RANDOM} <= set(methods):
        sheets += [
            guided_against_random_tables.hazard_odds_sheet(frame, published),
            guided_against_random_tables.hazards_by_fault_type_sheet(frame, published),
            guided_against_random_tables.matched_pairs_sheet(frame),
        ]
    sheets.append(event_time_and_order_tables.propagation_sheet(frame, published, has_alerts=has_alerts))
    if end_by_scenario is not None and has_alerts:
        driver_s = published.driver_reaction_s if published else DEFAULT_DRIVER_REACTION_S
        sheets.append(event_time_and_order_tables.alert_to_hazard_sheet(frame, end_by_scenario, driver_s))
    if first_alerts_by_hazard_run is not None and first_alerts_by_hazard_run.keys() >= set(
        frame.loc[frame["is_hazard"], "experiment_id"]
    ):
        sheets.append(
            event_time_and_order_tables.alerts_before_hazards_sheet(frame, first_alerts_by_hazard_run)
        )
    sheets.append(event_time_and_order_tables.hazard_orders_sheet(frame))
    return tuple(sheet for sheet in sheets if sheet.lines)
