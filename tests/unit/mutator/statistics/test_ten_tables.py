"""Every number in a report's tables is computed a second time by hand, for ten made-up campaigns."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest

from mutator.statistics.shares_with_intervals import Share
from mutator.statistics.sheet_selection import run_sheets
from mutator.statistics.statistics_sheet import Sheet

from . import by_hand
from .by_hand import ENDS, Row
from .results_frame import results

DRIVER_S = 1.8
METHODS = ("guided", "random")
WHOLES = ("activated", "injected")


@dataclass(frozen=True)
class Campaign:
    rows: list[Row]
    sheets: dict[str, Sheet]

    def of(self, method: str, **wanted: str) -> list[Row]:
        return [
            row
            for row in self.rows
            if row["method"] == method and all(row[name] == value for name, value in wanted.items())
        ]

    def lines(self, name: str) -> list[tuple[Any, ...]]:
        return list(self.sheets[name].lines)


@cache
def campaign(seed: int) -> Campaign:
    made = by_hand.made_up(seed)
    rows = [{k: v for k, v in row.items() if k != "raised"} for row in made]
    alerts = {str(i): tuple(row.get("raised", ())) for i, row in enumerate(made)}
    sheets = run_sheets(results(*rows), None, alerts, ENDS)
    return Campaign(by_hand.usable(made), {sheet.name: sheet for sheet in sheets})


# The quick tests run three campaigns, and the slow tests all ten.
SEEDS = [pytest.param(seed, marks=pytest.mark.slow if seed > 2 else ()) for seed in range(10)]


@pytest.fixture(params=SEEDS)
def made(request: pytest.FixtureRequest) -> Campaign:
    return campaign(request.param)


def same(found: Sequence[object], expected: Sequence[object]) -> bool:
    assert len(found) == len(expected)
    for cell, wanted in zip(found, expected, strict=True):
        if isinstance(cell, Share):
            count, of = wanted  # type: ignore[misc]
            assert (cell.count, cell.of) == (count, of)
            assert (cell.low, cell.high) == pytest.approx(by_hand.wilson(count, of), abs=1e-9, nan_ok=True)
        elif isinstance(wanted, float):
            assert cell == pytest.approx(wanted, rel=1e-9, abs=1e-12, nan_ok=True)
        else:
            assert cell == wanted
    return True


@pytest.mark.slow
def test_there_are_ten_campaigns_with_every_table() -> None:
    made = [campaign(seed) for seed in range(10)]
    assert all(len(one.sheets) == 11 for one in made)
    assert min(len(one.rows) for one in made) < 40 and max(len(one.rows) for one in made) > 200


@pytest.mark.parametrize("method", METHODS)
def test_summary_by_scenario(made: Campaign, method: str) -> None:
    lines = made.lines(f"summary_{method}")
    scenarios = sorted({row["scenario"] for row in made.of(method)})
    groups = [by_hand.counts(made.of(method, scenario=s)) for s in scenarios]
    groups.append(by_hand.counts(made.of(method)))
    assert len(lines) == 9
    for part, whole, _, *cells in lines:
        assert same(cells, [(group[part], group[whole]) for group in groups])


@pytest.mark.parametrize("method", METHODS)
def test_coverage_by_fault_type(made: Campaign, method: str) -> None:
    kinds = sorted({by_hand.kind_of(row) for row in made.of(method)})
    for (name, _, *cells), kind in zip(made.lines(f"coverage_{method}"), [*kinds, "total"], strict=True):
        told = by_hand.counts([r for r in made.of(method) if kind in ("total", by_hand.kind_of(r))])
        assert name == kind
        pairs = (("activated", "injected"), ("hazards", "activated"), ("hazards", "injected"))
        assert same(cells, [(told[part], told[whole]) for part, whole in pairs])


def test_guided_against_random(made: Campaign) -> None:
    for line, whole in zip(made.lines("guided_against_random"), WHOLES, strict=True):
        tables = by_hand.fourfolds(made.rows, whole)
        odds = by_hand.pooled_odds(tables.values())
        a, b, c, d = (sum(cells) for cells in zip(*tables.values(), strict=True))
        assert line[0] == whole and same(line[2:5], [(a, a + b), (c, c + d), len(tables)])
        assert same(line[5:10], list(odds.values()))


def test_resampled_difference_of_rates(made: Campaign) -> None:
    """Two resamplings of whole faults agree only approximately."""
    for line, whole in zip(made.lines("guided_against_random"), WHOLES, strict=True):
        rows = [row for row in made.rows if whole == "injected" or "t_activation" in row]
        faults = {row["fault_id"] for row in rows}
        clusters = [[row for row in rows if row["fault_id"] == fault] for fault in sorted(faults)]
        difference, low, high, number = line[10:]
        assert same([difference, number], [by_hand.rate_difference(rows), len(faults)])
        assert low <= difference <= high
        assert (low, high) == pytest.approx(
            by_hand.bootstrap(clusters, by_hand.rate_difference, 2000), abs=0.08 * (high - low)
        )


def test_fisher_and_holm_by_fault_type(made: Campaign) -> None:
    lines = made.lines("guided_against_random_by_fault_type")
    expected: list[tuple[Any, ...]] = []
    for whole in WHOLES:
        tables = by_hand.fourfolds(made.rows, whole)
        p_values = [by_hand.fisher(table) for table in tables.values()]
        for (kind, (a, b, c, d)), p, adjusted in zip(
            tables.items(), p_values, by_hand.holm(p_values), strict=True
        ):
            expected.append((whole, "here", kind, (a, a + b), (c, c + d), p, adjusted))
    assert len(lines) == len(expected)
    assert all(same(line, wanted) for line, wanted in zip(lines, expected, strict=True))


def test_matched_pairs(made: Campaign) -> None:
    pairs = by_hand.matched(made.rows)
    expected: list[list[Any]] = []
    for which, some in (
        ("all", pairs),
        ("guided one activated", [pair for pair in pairs if "t_activation" in pair[0]]),
    ):
        expected.append([which, "total", *_pair_counts(some), None])
        kinds = sorted({by_hand.kind_of(guided) for guided, _ in some})
        parts = [_pair_counts([p for p in some if by_hand.kind_of(p[0]) == kind]) for kind in kinds]
        adjusted = by_hand.holm([part[-1] for part in parts])
        expected += [[which, *told] for told in _rows(kinds, parts, adjusted)]
    lines = made.lines("matched_pairs")
    assert len(lines) == len(expected)
    assert all(same(line, wanted) for line, wanted in zip(lines, expected, strict=True))


def _rows(kinds: list[str], parts: list[list[Any]], adjusted: list[float]) -> list[list[Any]]:
    return [[kind, *part, p] for kind, part, p in zip(kinds, parts, adjusted, strict=True)]


def _pair_counts(pairs: list[tuple[Row, Row]]) -> list[Any]:
    hazards = Counter(tuple(by_hand.hazard_at(row) is not None for row in pair) for pair in pairs)
    first, second = hazards[True, False], hazards[False, True]
    counts = [len(pairs), hazards[True, True], first, second, hazards[False, False]]
    return [*counts, by_hand.sign_test(first, second)]


def test_propagation_times(made: Campaign) -> None:
    steps = {
        "activation to manifest": lambda r: _span(r, "t_activation", "t_manifest"),
        "activation to alert": lambda r: _span(r, "t_activation", "t_alert"),
        "activation to hazard": lambda r: _until_hazard(r, "t_activation"),
        "alert to hazard": lambda r: _until_hazard(r, "t_alert") if _warned(r) else None,
    }
    lines = iter(made.lines("propagation"))
    for method, scenario, rows in _groups(made):
        for step, span in steps.items():
            times = [t for t in map(span, rows) if t is not None]
            assert same(next(lines), [method, scenario, step, *by_hand.spread(times)])
    assert next(lines, None) is None


def test_from_alert_to_hazard(made: Campaign) -> None:
    lines = iter(made.lines("alert_to_hazard"))
    for method, scenario, rows in _groups(made):
        alerted = [row for row in rows if "t_alert" in row and row["status"] == "ok"]
        first = [row for row in alerted if by_hand.hazard_at(row) is None or _warned(row)]
        times = [
            (round((by_hand.hazard_at(r) or ENDS[r["scenario"]]) - r["t_alert"], 6), _warned(r))
            for r in first
        ]
        events = sum(came for _, came in times)
        curve = [1.0, *(s for t, s, _, _ in by_hand.kaplan_meier(times) if t <= DRIVER_S)]
        late = sum(came and t > DRIVER_S for t, came in times)
        counts = [len(first), events, len(first) - events, len(alerted) - len(first)]
        median = by_hand.median_time(times) if events else [math.nan] * 3
        last = [curve[-1] if first else math.nan, (late, events)]
        assert same(next(lines), [method, scenario, *counts, *median, *last])
    assert next(lines, None) is None


def test_alerts_before_hazards(made: Campaign) -> None:
    expected: list[tuple[Any, ...]] = []
    for method, hazard in ((m, h) for m in METHODS for h in ("H1", "H3")):
        time = f"t_{hazard.lower()}"
        hit = [row for row in made.of(method) if time in row]
        before = [{name for name, t in row.get("raised", ()) if t < row[time]} for row in hit]
        names = sorted(set().union(*before))
        told = {name: sum(name in some for some in before) for name in names}
        told |= {"any": sum(map(bool, before)), "none": sum(not some for some in before)}
        expected += [(method, hazard, name, (count, len(hit))) for name, count in told.items() if hit]
    lines = made.lines("alerts_before_hazards")
    assert len(lines) == len(expected)
    assert all(same(line, wanted) for line, wanted in zip(lines, expected, strict=True))


def test_orders_of_hazards(made: Campaign) -> None:
    counts: Counter[tuple[str, str, str]] = Counter()
    for row in made.rows:
        h1, h3 = row.get("t_h1"), row.get("t_h3")
        if h1 is None and h3 is None:
            continue
        if h1 is None or h3 is None:
            order = "H3" if h1 is None else "H1"
        elif h1 == h3:
            order = "H1 with H3"
        else:
            order = "H1 then H3" if h1 < h3 else "H3 then H1"
        counts[row["method"], row["module"], order] += 1
    assert {line[:3]: line[3] for line in made.lines("hazard_orders")} == dict(counts)


def _groups(made: Campaign) -> list[tuple[str, str, list[Row]]]:
    found = []
    for method in METHODS:
        for scenario in sorted({row["scenario"] for row in made.of(method)}):
            found.append((method, scenario, made.of(method, scenario=scenario)))
        found.append((method, "total", made.of(method)))
    return found


def _span(row: Row, start: str, end: str) -> float | None:
    return row[end] - row[start] if start in row and end in row else None


def _until_hazard(row: Row, start: str) -> float | None:
    end = by_hand.hazard_at(row)
    return end - row[start] if start in row and end is not None else None


def _warned(row: Row) -> bool:
    end = by_hand.hazard_at(row)
    return end is not None and "t_alert" in row and row["t_alert"] < end
