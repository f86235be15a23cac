"""Select the statistical tables that fit a run's results."""

from collections.abc import Mapping

import pandas as pd

from mutator.statistics import event_time_tables, guided_against_random_tables, summary_tables
from mutator.statistics.event_times import Alerts
from mutator.statistics.guided_against_random import GUIDED, RANDOM
from mutator.statistics.published_counts import Published
from mutator.statistics.results_frame import slim
from mutator.statistics.statistics_sheet import Sheet
from mutator.statistics.tallies import by_kind, by_scenario

_DRIVER_S = 1.8  # a driver's reaction time to a visible warning; used if no publication states one


def run_sheets(
    frame: pd.DataFrame,
    published: Published | None,
    alerts: Alerts | None,
    ends: Mapping[str, float] | None,
) -> tuple[Sheet, ...]:
    """Return the tables of a frame. A single method without published counts gets none, because they would
    only repeat counts.

    `alerts` has the alerts of each run with a hazard (None: the target has no alerts); they decide which
    event came first. `ends` maps each scenario to the end of its runs in simulated seconds; censored times
    need it. Tables whose inputs are missing are left out.
    """
    frame = slim(frame)
    if not published and not {GUIDED, RANDOM} <= set(frame["method"]):
        return ()
    scenarios, kinds = by_scenario(frame), by_kind(frame)
    methods = sorted({method for method, _ in scenarios})
    has_alerts = alerts is not None
    made = [
        summary_tables.summary_sheet(method, scenarios, published, alerts=has_alerts) for method in methods
    ]
    made += [summary_tables.coverage_sheet(method, kinds, published) for method in methods]
    if {GUIDED, RANDOM} <= set(methods):
        made += [
            guided_against_random_tables.overall_sheet(frame, published),
            guided_against_random_tables.kinds_sheet(frame, published),
            guided_against_random_tables.pairs_sheet(frame),
        ]
    made.append(event_time_tables.propagation_sheet(frame, published, alerts=has_alerts))
    if ends is not None and has_alerts:
        driver_s = published.driver_s if published else _DRIVER_S
        made.append(event_time_tables.reaction_sheet(frame, ends, driver_s))
    if alerts is not None and alerts.keys() >= set(frame.loc[frame["is_hazard"], "experiment_id"]):
        made.append(event_time_tables.alerts_sheet(frame, alerts))
    made.append(event_time_tables.orders_sheet(frame))
    return tuple(sheet for sheet in made if sheet.lines)
