"""Times from the activation, censored reaction times, and the order of alerts and hazards."""

from math import isnan, nan
from typing import Any

import pytest

from mutator.statistics import event_time_statistics
from mutator.statistics.event_time_and_order_tables import (
    alert_to_hazard_sheet,
    alerts_before_hazards_sheet,
    hazard_orders_sheet,
    propagation_sheet,
)

from .results_frame import results

ENDS = {"S1": 30.0, "S2": 20.0}
DRIVER_S = 1.8


def run(alert: float = nan, hazard: float = nan, **more: Any) -> dict[str, Any]:
    """A run that is activated at 5 s, with the times of its first alert and of H1, in seconds."""
    return {
        "t_activation": 5.0,
        "t_alert": alert,
        "alerts": "" if isnan(alert) else "fcw",
        "t_h1": hazard,
    } | more


def test_times_are_measured_from_the_activation() -> None:
    found = event_time_statistics.propagation_spreads_by_step(
        results(run(7.0, 9.0, t_manifest=5.5), run(6.0, nan), run(nan, nan), {})
    )
    assert (found["activation to manifest"].time_count, found["activation to manifest"].mean) == (1, 0.5)
    assert (found["activation to alert"].time_count, found["activation to alert"].mean) == (2, 1.5)
    assert (found["activation to hazard"].time_count, found["activation to hazard"].median) == (1, 4.0)
    assert (found["alert to hazard"].time_count, found["alert to hazard"].mean) == (1, 2.0)


def test_a_hazard_exactly_at_a_time_has_come_by_then() -> None:
    frame = results(*({"time_to_hazard": time} for time in (0.3, 1.8, 1.8000001, 4.0, nan)))
    shares = [event_time_statistics.share_of_hazards_within(frame, time) for time in (0.0, 0.3, 1.8, 9.0)]
    assert [(share.count, share.of) for share in shares] == [(0, 4), (1, 4), (3, 4), (4, 4)]


def test_a_reaction_time_needs_an_earlier_alert() -> None:
    frame = results(run(9.0, 9.0), run(9.5, 9.0), run(nan, 9.0))
    assert event_time_statistics.propagation_spreads_by_step(frame)["alert to hazard"].time_count == 0
    found = event_time_statistics.alert_to_hazard_times(frame, ENDS, DRIVER_S)
    assert (found.runs_alerted_first, found.hazards_after_alert, found.runs_alerted_too_late) == (0, 0, 2)
    assert isnan(found.no_hazard_share)


def test_kaplan_meier_of_a_textbook_sample() -> None:
    frame = results(
        *(run(10.0, hazard) for hazard in (11.0, 12.0, 12.5, 14.0)),
        run(17.0, nan, scenario="S2"),
        run(nan, 8.0),
    )
    found = event_time_statistics.alert_to_hazard_times(frame, ENDS, DRIVER_S)
    assert (found.runs_alerted_first, found.hazards_after_alert) == (5, 4)
    assert found.median_s == 2.5
    assert found.median_low_s <= 2.5 <= found.median_high_s
    assert found.no_hazard_share == pytest.approx(0.8)
    assert (found.late_hazard_share.count, found.late_hazard_share.of) == (3, 4)


def test_censored_times_raise_the_median() -> None:
    """A curve that never reaches one half has no median."""
    few = [run(10.0, 11.0 + i) for i in range(3)]
    assert event_time_statistics.alert_to_hazard_times(
        results(*few), ENDS, DRIVER_S
    ).median_s == pytest.approx(2.0)
    many = event_time_statistics.alert_to_hazard_times(results(*few, *[run(10.0, nan)] * 7), ENDS, DRIVER_S)
    assert isnan(many.median_s)
    assert many.no_hazard_share == pytest.approx(0.9)


def test_alerts_without_any_hazard_have_no_median() -> None:
    found = event_time_statistics.alert_to_hazard_times(results(run(10.0, nan)), ENDS, DRIVER_S)
    assert (found.no_hazard_share, found.runs_alerted_first, found.hazards_after_alert) == (1.0, 1, 0)
    assert isnan(found.median_s)


def test_crashed_runs_are_left_out_of_censored_times() -> None:
    """How long they would have been observed is unknown."""
    assert (
        event_time_statistics.alert_to_hazard_times(
            results(run(10.0, nan, status="crashed")), ENDS, DRIVER_S
        ).runs_alerted_first
        == 0
    )


def test_a_reaction_time_equal_to_the_drivers_is_not_longer() -> None:
    """11.8 - 10.0 is 1.8000000000000007 in floating point and counts as 1.8 s."""
    assert (
        event_time_statistics.alert_to_hazard_times(
            results(run(10.0, 11.8)), ENDS, DRIVER_S
        ).late_hazard_share.count
        == 0
    )


def test_alerts_are_counted_before_each_hazard() -> None:
    frame = results(run(8.0, 9.0), run(9.0, 10.0, t_h3=8.0), run(nan, nan, t_h3=8.0), run(nan, 9.0))
    alerts = {
        "0": (("steer_saturated", 8.0), ("fcw", 8.5)),
        "1": (("fcw", 9.0), ("steer_saturated", 10.0)),  # the second alert comes with the hazard
        "2": (),
        "3": (),
    }
    found = event_time_statistics.alert_first_share_by_hazard_and_alert(frame, alerts)
    assert {key: (share.count, share.of) for key, share in found.items()} == {
        ("H1", "fcw"): (2, 3),
        ("H1", "steer_saturated"): (1, 3),
        ("H1", "any"): (2, 3),
        ("H1", "none"): (1, 3),
        ("H3", "any"): (0, 2),
        ("H3", "none"): (2, 2),
    }


def test_the_orders_of_hazards_are_counted() -> None:
    frame = results(run(nan, 9.0), run(nan, 9.0, t_h3=7.0), run(nan, 9.0, t_h3=9.0), run())
    assert event_time_statistics.run_count_by_hazard_order(frame) == {
        "H1": 1,
        "H1 with H3": 1,
        "H3 then H1": 1,
    }


def test_sheets_have_lines_for_each_method_and_scenario() -> None:
    frame = results(run(8.0, 9.0), run(8.0, nan, scenario="S2"), run(nan, 7.0, method="random"))
    sheets = (
        propagation_sheet(frame, None),
        alert_to_hazard_sheet(frame, ENDS, DRIVER_S),
        alerts_before_hazards_sheet(frame, {"0": (("fcw", 8.0),), "1": (("fcw", 8.0),), "2": ()}),
        hazard_orders_sheet(frame),
    )
    assert all(len(line) == len(sheet.heads) for sheet in sheets for line in sheet.lines)
    groups = [line[:2] for line in sheets[1].lines]
    assert groups == [("guided", s) for s in ("S1", "S2", "total")] + [("random", s) for s in ("S1", "total")]
    told = [(*line[:3], str(line[3]).split(";")[0]) for line in sheets[2].lines]
    assert told == [
        ("guided", "H1", "fcw", "100.0 % (1/1"),
        ("guided", "H1", "any", "100.0 % (1/1"),
        ("guided", "H1", "none", "0.0 % (0/1"),
        ("random", "H1", "any", "0.0 % (0/1"),
        ("random", "H1", "none", "100.0 % (1/1"),
    ]
