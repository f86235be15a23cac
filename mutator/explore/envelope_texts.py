"""Envelopes and findings in words and as tables."""

from collections import Counter
from collections.abc import Sequence

from mutator._common.message_text import SHORT_ID_LENGTH, counted
from mutator._common.phrase_texts import with_unit
from mutator._common.table_rendering import TextTable
from mutator.campaigns.exploration_section import ExploredPlane
from mutator.explore.cell_results import CellState
from mutator.explore.challengers import describe_challenger
from mutator.explore.challenges import TABLE_DURATIONS_S, ChallengedBound
from mutator.explore.envelope import Envelope
from mutator.explore.finding_search import Finding
from mutator.explore.lattice import Cell

_HEADS = ("fault", "scenario", "from")


def describe_envelope(envelope: Envelope) -> str:
    """Return what is survived and what is not, in one sentence."""
    plane = envelope.plane
    where = f"{plane.spec} in {plane.scenario} from {start_text(envelope)}"
    failing = first_failing_line(envelope)
    longest = f"{envelope.longest_tried_s:g} s"
    if not envelope.was_active:
        return f"{where}: the fault was never active, so nothing can be said"
    if failing is None:
        largest = f"up to {_magnitude_text(envelope, -1)} for {longest}"
        return f"{where}: {_undecided_text(envelope)}no hazard found, {largest}"
    if envelope.magnitudes == (None,):
        return f"{where}: {_durations_text(envelope)}"
    survived = envelope.largest_survived()
    survives = (
        f"no hazard found up to {magnitude_text(envelope, survived)} for any duration up to {longest}; "
        if survived is not None
        else ""
    )
    duration = envelope.shortest_hazardous_s(failing)
    return f"{where}: {survives}{_magnitude_text(envelope, failing)} for {duration:g} s is hazardous"


def _undecided_text(envelope: Envelope) -> str:
    """Return how many cells that leave time to observe are not called survived, and why; empty if all are."""
    decidable = range(envelope.exploration.decidable)
    count = sum(not line[j].is_without_hazard for line in envelope.cells for j in decidable)
    reasons = Counter(
        result.reason
        for (_, j), result in envelope.exploration.map.results.items()
        if result.reason and j in decidable
    )
    why = f" ({reasons.most_common(1)[0][0]})" if reasons else ""
    return (
        f"{count:,} of {len(envelope.cells) * len(decidable):,} cells not decided or not survived{why}; "
        if count
        else ""
    )


def _durations_text(envelope: Envelope) -> str:
    """Return which durations of a fault without a value are survived, up to the first that is not."""
    survived, hazardous = envelope.longest_survived_s(0), envelope.shortest_hazardous_s(0)
    not_survived = f"not survived for {hazardous:g} s"
    return not_survived if survived is None else f"survived for up to {survived:g} s, {not_survived}"


def first_failing_line(envelope: Envelope) -> int | None:
    """Return the smallest magnitude with a hazardous cell; None without one."""
    lines = (i for i, line in enumerate(envelope.cells) if any(state.is_hazardous for state in line))
    return next(lines, None)


def envelope_table(envelopes: Sequence[Envelope]) -> TextTable:
    """Return a row for each envelope: what is survived, and what the largest magnitude does."""
    heads = [*_HEADS, "any time", *(f"{d:g} s" for d in TABLE_DURATIONS_S), "largest", "for", "hazard after"]
    rows = [_table_row(envelope) for envelope in envelopes]
    return TextTable(heads=heads, rows=rows, right_aligned=range(len(_HEADS), len(heads)))


def _table_row(envelope: Envelope) -> list[str]:
    plane = envelope.plane
    durations: tuple[float | None, ...] = (None, *TABLE_DURATIONS_S)
    last = len(envelope.magnitudes) - 1
    longest, time = envelope.longest_survived_s(last), envelope.time_to_hazard_s(last)
    return [
        plane.spec,
        plane.scenario,
        start_text(envelope),
        *(_survived_text(envelope, duration) for duration in durations),
        _magnitude_text(envelope, last),
        _longest_text(envelope, longest),
        "-" if time is None else f"{time:.2f} s",
    ]


def describe_validation(envelope: Envelope) -> str:
    """Return how many cells were driven, and what the validation found."""
    runs = f"{counted(envelope.run_count, 'run')} for {envelope.exploration.map.lattice.size:,} cells"
    runs += f", each with {envelope.plane.seeds} seeds" if envelope.plane.seeds > 1 else ""
    validation = envelope.validation
    if validation is None:
        return f"{runs}; not validated"
    if not validation.drawn:
        return f"{runs}; no other cell is called without hazard"
    if envelope.exploration.is_search_cut_off:
        runs += "; the search ended by its limit"
    driven = sum(cell in envelope.exploration.map.results for cell in validation.drawn)
    if driven < len(validation.drawn):
        return f"{runs}; the validation is unfinished: {driven} of {len(validation.drawn)} drawn cells driven"
    states = [envelope.exploration.map.state(cell) for cell in validation.drawn]
    hazardous = f"{states.count(CellState.HAZARDOUS)} of {len(states)} drawn cells hazardous"
    disengaged = states.count(CellState.DISENGAGED)
    return f"{runs}; {hazardous}{f', {disengaged} disengaged' if disengaged else ''}"


def findings_table(findings: Sequence[Finding], planes: Sequence[ExploredPlane]) -> TextTable:
    """Return a row for each finding, those of the shortest faults first."""
    heads = ("fault", "scenario", "from", "hazard", "smallest", "for", "hazard after", "experiment")
    ordered = shortest_first(findings, planes)
    rows = [_finding_row(finding, planes[finding.plane]) for finding in ordered]
    return TextTable(heads=heads, rows=rows, right_aligned=(4, 5, 6))


def describe_finding(finding: Finding, plane: ExploredPlane) -> str:
    """Return the hazard and the fault that reached it, in one sentence."""
    spec, scenario, start, hazard, smallest, duration, after, _ = _finding_row(finding, plane)
    fault = spec if smallest == "-" else f"{spec} {smallest}"
    return f"{fault} in {scenario} from {start} for {duration}: {hazard} after {after}"


def shortest_first(findings: Sequence[Finding], planes: Sequence[ExploredPlane]) -> list[Finding]:
    """Return the findings, those of the shortest faults first."""
    return sorted(findings, key=lambda finding: (_duration_s(finding, planes), finding.plane))


def _finding_row(finding: Finding, plane: ExploredPlane) -> list[str]:
    line, duration = finding.cell
    magnitude = with_unit(f"{plane.magnitudes[line]:g}", plane.unit) if plane.magnitudes else "-"
    return [
        plane.spec,
        plane.scenario,
        plane.start,
        finding.hazard,
        magnitude,
        f"{plane.durations_s[duration]:g} s{' (inferred)' if finding.is_inferred else ''}",
        f"{finding.result.time_to_hazard_s:.2f} s",
        finding.result.experiment_id[:8],
    ]


def _duration_s(finding: Finding, planes: Sequence[ExploredPlane]) -> float:
    return planes[finding.plane].durations_s[finding.cell[1]]


def magnitude_text(envelope: Envelope, magnitude: float | None) -> str:
    """Return a magnitude with its unit; the fault alone if it has no value."""
    return "the fault" if magnitude is None else with_unit(f"{magnitude:g}", envelope.plane.unit)


def _magnitude_text(envelope: Envelope, line: int) -> str:
    return magnitude_text(envelope, envelope.magnitudes[line])


def _survived_text(envelope: Envelope, duration_s: float | None) -> str:
    if (challenge := envelope.challenged(duration_s)) and challenge.is_lowered:
        return level_text(envelope, challenge)
    survived = envelope.largest_survived(duration_s)
    if survived is None and envelope.magnitudes != (None,):
        return "none"
    return "-" if survived is None else magnitude_text(envelope, survived)


def _longest_text(envelope: Envelope, longest_s: float | None) -> str:
    if (challenge := envelope.challenged_longest()) and challenge.is_lowered:
        return level_text(envelope, challenge)
    return "-" if longest_s is None else f"{longest_s:g} s"


def level_text(envelope: Envelope, challenge: ChallengedBound) -> str:
    """Return up to where challengers are survived: a magnitude or a duration."""
    if challenge.level is None:
        return "none"
    if challenge.bound.is_duration:
        return f"{envelope.durations_s[challenge.level]:g} s"
    return magnitude_text(envelope, envelope.magnitudes[challenge.level])


def cell_text(envelope: Envelope, cell: Cell) -> str:
    """Return the fault of a cell: `2.5 mph for 1 s`."""
    return f"{magnitude_text(envelope, envelope.magnitudes[cell[0]])} for {envelope.durations_s[cell[1]]:g} s"


def describe_challenges(envelope: Envelope) -> list[str]:
    """Return a sentence for each bound that challengers lowered, or that says why there is none."""
    if not envelope.is_challenged:
        return ["not challenged"]
    if not envelope.exploration.is_complete:
        return ["not challenged to the end"]
    lowered = [challenge for challenge in envelope.challenges if challenge.is_lowered]
    return [describe_challenge(envelope, challenge) for challenge in lowered] or ["survives all challengers"]


def describe_challenge(envelope: Envelope, challenge: ChallengedBound) -> str:
    """Return by what a lowered bound is lowered, and to where."""
    assert challenge.failed and challenge.result
    survived = level_text(envelope, challenge)
    after = "no smaller one survives all challengers" if survived == "none" else f"{survived} survives all"
    what = challenge.result.hazard or challenge.result.reason or "not survived"
    failed = f"{cell_text(envelope, challenge.failed)}, {describe_challenger(challenge.challenger)}"
    run = challenge.result.experiment_id[:SHORT_ID_LENGTH]
    constant = f"{cell_text(envelope, challenge.bound.cell)} is survived if constant"
    return f"{constant}, but {failed}, is not ({what}, run {run}); {after}"


def fault_text(envelope: Envelope) -> str:
    """Return the name of the fault, with its sign if that is negative."""
    is_negative = (envelope.magnitudes[0] or 0.0) < 0
    return f"{envelope.plane.spec} (negative)" if is_negative else envelope.plane.spec


def name_of_plane(envelope: Envelope) -> str:
    """Return the fault, scenario and start: `sensor/bias/distance (negative) in S1 from 5 s`."""
    return f"{fault_text(envelope)} in {envelope.plane.scenario} from {start_text(envelope)}"


def start_text(envelope: Envelope) -> str:
    start = envelope.plane.start
    return f"{start} s" if start.replace(".", "", 1).isdigit() else f"{start} ({envelope.drive.start_s:g} s)"
