"""The statistics of a report, computed a second time in plain Python from formulas, without the harness. Rows
are the dicts that `made_up` draws. A missing time has no key."""

import math
import random
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import Any

Row = Mapping[str, Any]
Z = statistics.NormalDist().inv_cdf(0.975)
KINDS = ("radar/chaff", "radar/jamming", "camera/rain", "car/speed")
ENDS = {"S1": 30.0, "S2": 24.5, "S3": 40.0}
ALERTS = ("fcw", "steer_saturated", "driver_distracted")


def made_up(seed: int) -> list[dict[str, Any]]:
    """Draw a campaign of guided and random runs, some without a partner, some crashed. Times are multiples of
    0.1 s, so that there are ties."""
    draw = random.Random(seed)
    faults = draw.randint(4, 30)
    scenarios = list(ENDS)[: draw.randint(1, 3)]
    harm = {kind: draw.uniform(0.05, 0.95) for kind in KINDS[: draw.randint(2, 4)]}
    alarm, tame = draw.uniform(0.2, 0.9), draw.uniform(0.5, 1.0)
    rows = []
    for fault, scenario, context in product(range(faults), scenarios, ("C1", "C2")):
        kind = list(harm)[fault % len(harm)]
        for method in ("guided", "random"):
            if draw.random() < 0.05:  # this run is still missing
                continue
            module, fault_type = kind.split("/")
            trigger = context if method == "guided" else f"random/{context}"
            row = {"module": module, "fault_type": fault_type, "fault_id": f"f{fault}"}
            row |= {"scenario": scenario, "method": method, "trigger": trigger, "status": "ok"}
            chance = harm[kind] * (1.0 if method == "guided" else tame)
            rows.append(row | _outcome(draw, ENDS[scenario], chance, alarm))
    return rows


def _outcome(draw: random.Random, end: float, harm: float, alarm: float) -> dict[str, Any]:
    if draw.random() < 0.04:
        return {"status": draw.choice(["crashed", "timeout", "harness_error", "invalid_mutant"])}
    if draw.random() < 0.2:
        return {}
    start = round(draw.uniform(5.0, 15.0), 1)
    found: dict[str, Any] = {"t_activation": start}

    def later() -> float:
        return round(min(start + draw.expovariate(1 / 4), end), 1)

    if draw.random() < 0.8:
        found["t_manifest"] = later()
    raised = [(name, later()) for name in ALERTS if draw.random() < alarm / 2]
    if raised:
        raised.sort(key=lambda alert: alert[1])
        found |= {"t_alert": raised[0][1], "alerts": ";".join(name for name, _ in raised)}
        found["raised"] = raised
    for hazard in ("h1", "h3"):
        if draw.random() < harm / 1.5:
            found |= {hazard: 1, f"t_{hazard}": later()}
    return found


def usable(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if row["status"] not in ("harness_error", "invalid_mutant")]


def kind_of(row: Row) -> str:
    return f"{row['module']}/{row['fault_type']}"


def hazard_at(row: Row) -> float | None:
    return min((row[t] for t in ("t_h1", "t_h3") if t in row), default=None)


def counts(rows: Sequence[Row]) -> dict[str, int]:
    hazard = [hazard_at(row) is not None for row in rows]
    alert = ["t_alert" in row for row in rows]
    return {
        "injected": len(rows),
        "activated": sum("t_activation" in row for row in rows),
        "manifested": sum("t_manifest" in row for row in rows),
        "hazards": sum(hazard),
        "alerts": sum(alert),
        "hazards without alert": sum(h and not a for h, a in zip(hazard, alert, strict=True)),
        "alerts without hazard": sum(a and not h for h, a in zip(hazard, alert, strict=True)),
    }


def wilson(count: int, of: int) -> tuple[float, float]:
    """Wilson, Journal of the American Statistical Association 22 (1927): the roots p of
    (p - count/of)^2 = z^2 p (1 - p) / of."""
    if not of:
        return math.nan, math.nan
    rate, c = count / of, Z * Z / of
    half = math.sqrt(c * c / 4 + c * rate * (1 - rate))
    return (rate + c / 2 - half) / (1 + c), (rate + c / 2 + half) / (1 + c)


Fourfold = tuple[int, int, int, int]  # guided with and without hazard, random with and without


def fourfolds(rows: Sequence[Row], whole: str) -> dict[str, Fourfold]:
    found = {}
    for kind in sorted({kind_of(row) for row in rows}):
        cells: list[int] = []
        for method in ("guided", "random"):
            told = counts([r for r in rows if kind_of(r) == kind and r["method"] == method])
            cells += [told["hazards"], told[whole] - told["hazards"]]
        a, b, c, d = cells
        if a + b and c + d:
            found[kind] = (a, b, c, d)
    return found


def pooled_odds(tables: Iterable[Fourfold]) -> dict[str, float]:
    """Mantel and Haenszel (1959); variance by Robins, Breslow and Greenland (1986); the equality of the odds
    by Breslow and Day (1980)."""
    telling = [t for t in tables if 0 < t[0] + t[2] < sum(t)]
    r = [a * d / (a + b + c + d) for a, b, c, d in telling]
    s = [b * c / (a + b + c + d) for a, b, c, d in telling]
    p = [(a + d) / (a + b + c + d) for a, b, c, d in telling]
    big_r, big_s = sum(r), sum(s)
    variance = (
        sum(pi * ri for pi, ri in zip(p, r, strict=True)) / (2 * big_r**2)
        + sum(pi * si + (1 - pi) * ri for pi, ri, si in zip(p, r, s, strict=True)) / (2 * big_r * big_s)
        + sum((1 - pi) * si for pi, si in zip(p, s, strict=True)) / (2 * big_s**2)
    )
    ratio, width = big_r / big_s, Z * math.sqrt(variance)
    return {
        "odds ratio": ratio,
        "low": ratio * math.exp(-width),
        "high": ratio * math.exp(width),
        "p": chi_squared_tail(_cochran(telling), 1),
        "p equal": chi_squared_tail(sum(_breslow_day(t, ratio) for t in telling), len(telling) - 1),
    }


def _cochran(tables: Sequence[Fourfold]) -> float:
    excess = variance = 0.0
    for a, b, c, d in tables:
        n, first, hazards = a + b + c + d, a + b, a + c
        excess += a - first * hazards / n
        variance += first * (n - first) * hazards * (n - hazards) / (n * n * (n - 1))
    return excess**2 / variance


def _breslow_day(table: Fourfold, ratio: float) -> float:
    """The squared distance of a cell from its value at the common odds ratio, found by bisection."""
    a, b, c, d = table
    low, high = float(max(0, a - d)), float(min(a + b, a + c))
    for _ in range(200):
        x = (low + high) / 2
        too_few = x * (x + d - a) < ratio * (a + b - x) * (a + c - x)
        low, high = (x, high) if too_few else (low, x)
    return (a - x) ** 2 * (1 / x + 1 / (a + b - x) + 1 / (a + c - x) + 1 / (x + d - a))


def chi_squared_tail(x: float, df: int) -> float:
    """The recurrence in the degrees of freedom (Abramowitz and Stegun 26.4.4 and 26.4.5)."""
    tail = math.erfc(math.sqrt(x / 2)) if df % 2 else math.exp(-x / 2)
    for k in range(3 if df % 2 else 4, df + 1, 2):
        tail += math.exp((k / 2 - 1) * math.log(x / 2) - x / 2 - math.lgamma(k / 2))
    return tail


def fisher(table: Fourfold) -> float:
    """The probability of all tables with these margins that are no more likely than this one."""
    a, b, c, d = table
    first, hazards, n = a + b, a + c, a + b + c + d
    ways = {
        k: math.comb(hazards, k) * math.comb(n - hazards, first - k)
        for k in range(max(0, first + hazards - n), min(first, hazards) + 1)
    }
    return sum(w for w in ways.values() if w <= ways[a]) / sum(ways.values())


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm: the k-th smallest p-value times m - k + 1, but not less than an earlier one."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    adjusted, least = [0.0] * len(p_values), 0.0
    for rank, i in enumerate(order):
        least = max(least, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = least
    return adjusted


def matched(rows: Iterable[Row]) -> list[tuple[Row, Row]]:
    by_key: dict[tuple[str, ...], dict[str, Row]] = {}
    for row in rows:
        key = (row["fault_id"], row["scenario"], row["trigger"].removeprefix("random/"))
        by_key.setdefault(key, {})[row["method"]] = row
    return [(both["guided"], both["random"]) for both in by_key.values() if len(both) == 2]


def sign_test(first: int, second: int) -> float:
    """Two-sided sign test: the probability of at most as many heads, or tails, in this number of throws."""
    n, least = first + second, min(first, second)
    return min(1.0, 2 * sum(math.comb(n, k) for k in range(least + 1)) / 2**n)


def bootstrap(
    clusters: Sequence[Sequence[Row]], rate: Callable[[Sequence[Row]], float], draws: int
) -> tuple[float, float]:
    draw = random.Random(99)
    found = sorted(
        rate([row for cluster in draw.choices(clusters, k=len(clusters)) for row in cluster])
        for _ in range(draws)
    )
    return found[round(0.025 * draws)], found[round(0.975 * draws) - 1]


def rate_difference(rows: Sequence[Row]) -> float:
    hits, runs = {"guided": 0, "random": 0}, {"guided": 0, "random": 0}
    for row in rows:
        runs[row["method"]] += 1
        hits[row["method"]] += hazard_at(row) is not None
    return hits["guided"] / runs["guided"] - hits["random"] / runs["random"]


def spread(times: Sequence[float]) -> list[float]:
    if len(times) < 2:
        return [len(times), *(list(times) or [math.nan]) * 4]
    lower, median, upper = statistics.quantiles(times, n=4, method="inclusive")
    return [len(times), statistics.fmean(times), lower, median, upper]


def kaplan_meier(times: Sequence[tuple[float, bool]]) -> list[tuple[float, float, float, float]]:
    """Each step as (time, share, low, high): Kaplan and Meier (1958), with Greenwood's variance and
    log-log intervals."""
    steps, share, greenwood = [], 1.0, 0.0
    for at in sorted({time for time, came in times if came}):
        risk = sum(time >= at for time, _ in times)
        events = sum(time == at and came for time, came in times)
        share *= 1 - events / risk
        if events == risk:
            steps.append((at, 0.0, math.nan, math.nan))
            break
        greenwood += events / (risk * (risk - events))
        width = Z * math.sqrt(greenwood) / abs(math.log(share))
        steps.append((at, share, share ** math.exp(width), share ** math.exp(-width)))
    return steps


def median_time(times: Sequence[tuple[float, bool]]) -> tuple[float, float, float]:
    """The median and its interval. NaN means that the curve does not reach one half."""
    steps = kaplan_meier(times)
    at_half = [t for t, share, _, _ in steps if math.isclose(share, 0.5)]
    below = [t for t, share, _, _ in steps if share < 0.5 and not math.isclose(share, 0.5)]
    median = statistics.fmean([*at_half, *below[:1]]) if at_half else min(below, default=math.nan)
    inside = [t for t, _, low, high in steps if low <= 0.5 <= high]
    if not inside:
        return median, math.nan, math.nan
    beyond = [t for t, _, low, high in steps if t > max(inside) and not math.isnan(low)]
    return median, min(inside), min(beyond, default=math.inf)
