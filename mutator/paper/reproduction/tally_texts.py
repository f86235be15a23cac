"""Texts of counts for the pages of the study: shares, differences from the paper, what agrees with it."""

from collections.abc import Mapping

from mutator.statistics.shares_with_intervals import Share, share_with_interval
from mutator.statistics.tallies import Tally

NEAR_POINTS = 10.0  # a rate within so many points of the paper's is called near
_FRAME_FAULTS = "vision_input/"
AGREEMENT_LABELS = (
    "fault types whose hazards are within ten points of the paper's",
    "the others, with the difference in points",
    "effects in camera frames with hazards",
    "effects without",
    "of the hazards, those without an alert",
    "fault types that were activated exactly as often as in the paper",
)

NOTHING = Tally(
    injected=0, activated=0, hazards=0, manifested=0, alerts=0, hazards_no_alerts=0, alerts_no_hazards=0
)


def agreement_cells(
    tallies: Mapping[str, Tally], published: Mapping[str, Tally], total: Tally
) -> tuple[str, ...]:
    tallies = {kind: tally for kind, tally in tallies.items() if tally.activated}
    points = {kind: points_between(tally, published[kind], "hazards") for kind, tally in tallies.items()}
    far = {kind: value for kind, value in points.items() if abs(value) > NEAR_POINTS}
    equal = [kind for kind, tally in tallies.items() if tally.activated == published[kind].activated]
    frames = {kind: tally.hazards for kind, tally in tallies.items() if kind.startswith(_FRAME_FAULTS)}
    silent = total.hazards_no_alerts
    return (
        f"{len(points) - len(far)} of {len(points)}",
        ", ".join(f"{kind} ({value:+.0f})" for kind, value in far.items()) or "none",
        ", ".join(_last_name(kind) for kind, count in frames.items() if count) or "none",
        ", ".join(_last_name(kind) for kind, count in frames.items() if not count) or "none",
        "-" if silent is None else str(share_with_interval(silent, total.hazards)),
        "all" if len(equal) == len(tallies) else ", ".join(equal) or "none",
    )


def _last_name(kind: str) -> str:
    return kind.rpartition("/")[2]


def share_of_tally(tally: Tally, part: str, whole: str) -> Share:
    return share_with_interval(getattr(tally, part), getattr(tally, whole))


def count_text(tally: Tally, part: str) -> str:
    """Return `35.8 % (1316/3678)`, of the activated faults."""
    count, of = getattr(tally, part), tally.activated
    return f"{100 * count / of:.1f} % ({count}/{of})" if of else "-"


def percent_text(tally: Tally, part: str) -> str:
    return f"{100 * getattr(tally, part) / tally.activated:.1f} %" if tally.activated else "-"


def with_difference(tally: Tally, published_tally: Tally, part: str) -> str:
    if not tally.activated or not published_tally.activated:
        return "-"
    points = points_between(tally, published_tally, part)
    text = f"{points:+.0f}"
    return f"{percent_text(tally, part)} ({f'**{text}**' if abs(points) > NEAR_POINTS else text})"


def points_between(tally: Tally, published_tally: Tally, part: str) -> float:
    """Return the difference of two shares of activated faults, in points."""
    first, second = (share_of_tally(each, part, "activated").rate for each in (tally, published_tally))
    return 100 * (first - second)
