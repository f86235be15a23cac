"""What a report says of an exploration: its envelopes, worst first, in sentences and a table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

from mutator._common.message_text import counted
from mutator._common.phrase_texts import measured_time_text
from mutator._common.table_rendering import TextTable
from mutator.errors import MutatorError
from mutator.explore.challengers import describe_challenger
from mutator.explore.challenges import TABLE_DURATIONS_S, ChallengedBound
from mutator.explore.envelope import BoundaryPair, Envelope
from mutator.explore.envelope_failures import (
    Failure,
    count_validation,
    disengaged_cells,
    first_failure,
    hazardous_share,
)
from mutator.explore.envelope_texts import (
    cell_text,
    fault_text,
    level_text,
    magnitude_text,
    start_text,
)
from mutator.explore.exploration_replay import ExplorationReplay, is_exploration, replay_exploration
from mutator.report.plane_sentences import describe_plane, is_undecided, percent_text
from mutator.report.search_findings import SearchFindings
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from markupsafe import Markup

_TABLE_HEADS = (
    "fault",
    "scenario",
    "from",
    "survived for every duration",
    *(f"for {duration:g} s" for duration in TABLE_DURATIONS_S),
    "largest tried",
    "survived up to",
    "hazard after",
    "challengers lowered",
    "validation",
    "runs of cells",
)
NO_PROBABILITY_NOTE = (
    "Nothing here is a probability on the road: a search chose the runs, so no share of them, here or below, "
    "says how often faults or hazards occur."
)
TABLE_NOTE = (
    "“Survived” is the largest magnitude up to which every cell is called without hazard, driven or between "
    "runs, at this start in this scenario. Cells are of constant errors. Where a fault is challenged, the "
    "same size was also driven as errors that change: with alternating sign, growing, as noise and as a "
    "repeated glitch. If one of them is not survived, the largest size that survives all of them stands "
    "before that of a constant error. Faults whose error has no size with a sign are not challenged. “Every "
    "duration” ends with the longest that was tried, “for 1 s” with the next one that was. “Survived up to” "
    "and “hazard after” are of the largest magnitude: up to which duration all cells are called without "
    "hazard, and the time from the start of the longest fault to its hazard. “Validation” is the last, of "
    "cells that the search left undriven; its shares hold at 95 % for all validations of a plane together. "
    "Links open the run that shows the first hazard, beside a shorter one without. Cells called hazardous "
    "between runs are interpolated: validations do not draw them."
)
_CHALLENGE_HEADS = (
    "fault",
    "scenario",
    "from",
    "survived if constant",
    "survives all challengers",
    "not survived",
    "changing how",
    "what follows",
)
NO_BREAK = "\N{NO-BREAK SPACE}"
_Proof: TypeAlias = Failure | BoundaryPair | ChallengedBound


@dataclass(frozen=True, kw_only=True)
class ExploredPlanes:
    """The envelopes of a run, worst first: planes of one fault together, by their share of hazardous cells;
    without any, undecided planes first.

    `problem` says why there are none; `note` which planes are unfinished.
    """

    envelopes: Sequence[Envelope]
    hazards: Mapping[str, str] = field(default_factory=dict)  # what each is, by name
    note: str = ""
    problem: str = ""

    @classmethod
    def of_run(
        cls, folder: RunFolder, workspace: Workspace | None
    ) -> "ExploredPlanes | SearchFindings | None":
        """Return those of a run, or the findings of a search; None for a run without an exploration."""
        if not is_exploration(folder):
            return None
        if workspace is None:
            return cls(envelopes=(), problem="The envelopes are not shown, because there is no library here.")
        try:
            replay = replay_exploration(folder, workspace.manifest_of(folder.head))
        except (MutatorError, KeyError) as error:
            return cls(envelopes=(), problem=f"The envelopes cannot be shown: {error}")
        about = {hazard.name: hazard.about for hazard in folder.head.about_hazards}
        if not replay.differences and (findings := SearchFindings.of_replay(replay)):
            return findings
        return cls.of_replay(replay, about)

    @classmethod
    def of_replay(cls, replay: ExplorationReplay, hazards: Mapping[str, str]) -> "ExploredPlanes":
        for difference in replay.differences:
            return cls(envelopes=(), problem=f"The envelopes do not follow from the records: {difference}")
        return replace(cls.of_envelopes(replay.envelopes, hazards), note=replay.note)

    @classmethod
    def of_envelopes(cls, envelopes: Sequence[Envelope], hazards: Mapping[str, str]) -> "ExploredPlanes":
        ranks = [(-hazardous_share(envelope), not is_undecided(envelope)) for envelope in envelopes]
        worst_by_spec: dict[str, tuple[float, bool]] = {}
        for envelope, rank in zip(envelopes, ranks, strict=True):
            spec = envelope.plane.spec
            worst_by_spec[spec] = min(rank, worst_by_spec.get(spec, rank))
        pairs = sorted(
            zip(envelopes, ranks, strict=True),
            key=lambda pair: (worst_by_spec[pair[0].plane.spec], pair[0].plane.spec, pair[1]),
        )
        return cls(envelopes=[envelope for envelope, _ in pairs], hazards=hazards)

    def first_sentence(self) -> str:
        """Return up to where the worst plane has no hazard, where it first fails, and what shows it."""
        if not self.envelopes:
            return self.problem or "Nothing was driven yet."
        return describe_plane(self.envelopes[0], self.hazards)

    def describe_all(self) -> str:
        """Return how many planes there are, and how many are without any hazard; empty for a single one."""
        count = len(self.envelopes)
        if count < 2:
            return ""
        without = [envelope for envelope in self.envelopes if first_failure(envelope) is None]
        disengaged = sum(bool(disengaged_cells(envelope)) for envelope in without)
        undecided = sum(is_undecided(e) for e in without if not disengaged_cells(e))
        safe = len(without) - undecided - disengaged
        if safe == count:
            return f"No hazard was found in any of the {count} planes."
        parts = [f"in {safe} of them no hazard was found"] if safe else []
        parts += [f"in {disengaged} the controller only ended disengaged or crashed"] if disengaged else []
        parts += [f"{undecided} of them cannot be decided"] if undecided else []
        return (
            f"That is the first of {count} planes, by their share of hazardous cells; "
            f"{', '.join(parts) or 'each has a hazard'}."
        )

    def describe_scope(self) -> str:
        """Return what was driven, and that nothing else was; empty without planes."""
        if not self.envelopes:
            return ""
        planes = [envelope.plane for envelope in self.envelopes]
        faults = counted(len({plane.spec for plane in planes}), "fault")
        scenarios = ", ".join(dict.fromkeys(plane.scenario for plane in planes))
        starts = ", ".join(dict.fromkeys(map(start_text, self.envelopes)))
        longest_s = max(envelope.durations_s[-1] for envelope in self.envelopes)
        observe_s = self.envelopes[0].exploration.section.observe_s
        cells = sum(envelope.run_count for envelope in self.envelopes)
        challenges = sum(len(envelope.exploration.challenges.results) for envelope in self.envelopes)
        besides = f", and {counted(challenges, 'challenger')}" if challenges else ""
        return (
            f"Driven: {faults}, one at a time, in {scenarios}, from {starts} on, for up to {longest_s:g} s, "
            f"and observed for {observe_s:g} s more: {counted(cells, 'cell')}{besides}. Nothing is said of "
            "other faults, of sizes and durations between those that were tried, of several faults at once, "
            "of other drives and starts, and of what a driver does."
        )

    @property
    def linked_ids(self) -> set[str]:
        """The ids of the experiments to which the table has links."""
        proofs = [proof for envelope in self.envelopes for proof in _proofs(envelope)]
        proofs += [challenge for envelope in self.envelopes for challenge in envelope.challenges]
        return {name for proof in proofs if proof for name in _ids_of(proof)}

    def challenges_table(self, *, with_links: bool) -> TextTable:
        """Return a row for each bound that challengers lowered."""
        rows = [
            _challenge_row(envelope, challenge, with_links=with_links)
            for envelope in self.envelopes
            for challenge in envelope.challenges
            if challenge.is_lowered
        ]
        return TextTable(heads=_CHALLENGE_HEADS, rows=rows, right_aligned=range(3, 6))

    def table(self, *, with_links: bool) -> TextTable:
        """Return a row for each envelope; with links for the page, not for Markdown."""
        rows = [_row(envelope, with_links=with_links) for envelope in self.envelopes]
        return TextTable(heads=_TABLE_HEADS, rows=rows, right_aligned=range(3, 11))


def _proofs(envelope: Envelope) -> list[_Proof | None]:
    """Return what a row links: the first failure for every duration and for those of the table, and the
    border of the largest magnitude; or the challenger that lowers these.
    """
    durations = (None, *TABLE_DURATIONS_S)
    challenges = [*(envelope.challenged(duration) for duration in durations), envelope.challenged_longest()]
    failures = [first_failure(envelope, duration) for duration in durations]
    proofs = [*failures, envelope.boundary_pair(len(envelope.magnitudes) - 1)]
    return [c if c and c.is_lowered else proof for c, proof in zip(challenges, proofs, strict=True)]


def _ids_of(proof: _Proof) -> list[str]:
    """Return the id of the run with a hazard and, if there is one, of its neighbour without."""
    if isinstance(proof, ChallengedBound):
        return [proof.result.experiment_id] if proof.result else []
    if isinstance(proof, BoundaryPair):
        return [proof.hazardous.experiment_id, proof.without_hazard.experiment_id]
    neighbour = [proof.neighbour.experiment_id] if proof.neighbour else []
    return [proof.result.experiment_id, *neighbour]


def _row(envelope: Envelope, *, with_links: bool) -> list[str]:
    last = len(envelope.magnitudes) - 1
    longest, time_s = envelope.longest_survived_s(last), envelope.time_to_hazard_s(last)
    linked = [
        *(_survived_text(envelope, duration) for duration in (None, *TABLE_DURATIONS_S)),
        _longest_text(envelope, longest),
    ]
    if with_links:
        linked = [_linked(text, proof) for text, proof in zip(linked, _proofs(envelope), strict=True)]
    return [
        fault_text(envelope),
        envelope.plane.scenario,
        start_text(envelope),
        *linked[:-1],
        magnitude_text(envelope, envelope.magnitudes[last]) if envelope.plane.magnitudes else "-",
        linked[-1],
        "-" if time_s is None else measured_time_text(time_s),
        _short_challenge(envelope),
        _short_validation(envelope),
        f"{envelope.run_count} of {envelope.exploration.map.lattice.size:,}",
    ]


def _longest_text(envelope: Envelope, longest_s: float | None) -> str:
    if not envelope.was_active:
        return "not decided"
    constant = "none" if longest_s is None else f"{longest_s:g} s"
    return _with_challenge(envelope, envelope.challenged_longest(), constant)


def _with_challenge(envelope: Envelope, challenge: ChallengedBound | None, constant: str) -> str:
    """Return what survives all challengers before what is survived of a constant error, if it is less."""
    if challenge is None or not challenge.is_lowered:
        return constant
    return f"{level_text(envelope, challenge)} ({constant} if constant)"


def _short_challenge(envelope: Envelope) -> str:
    if not envelope.is_challenged:
        return "not challenged"
    if not envelope.exploration.is_complete:
        return "unfinished"
    lowered = sum(challenge.is_lowered for challenge in envelope.challenges)
    bounds = counted(len(envelope.challenges), "bound")
    return f"{lowered} of {bounds}" if envelope.challenges else "nothing survived"


def _challenge_row(envelope: Envelope, challenge: ChallengedBound, *, with_links: bool) -> list[str]:
    assert challenge.failed and challenge.result
    failed = cell_text(envelope, challenge.failed)
    result, time_s = challenge.result, challenge.result.time_to_hazard_s
    after = "" if time_s is None else f" after {measured_time_text(time_s)}"
    return [
        fault_text(envelope),
        envelope.plane.scenario,
        start_text(envelope),
        cell_text(envelope, challenge.bound.cell),
        level_text(envelope, challenge),
        _linked(failed, challenge) if with_links else failed,
        describe_challenger(challenge.challenger),
        f"{result.hazard}{after}" if result.hazard else result.reason.partition("\n")[0],
    ]


def _survived_text(envelope: Envelope, duration_s: float | None) -> str:
    """Return the largest magnitude that is survived; `yes` or `no` for a fault without a value."""
    if not envelope.was_active:
        return "not decided"
    survived = envelope.largest_survived(duration_s)
    if survived is not None:
        constant = magnitude_text(envelope, survived)
        return _with_challenge(envelope, envelope.challenged(duration_s), constant)
    if duration_s is not None and duration_s > envelope.durations_s[-1]:
        return "not tried"
    smallest, count = envelope.cells[0], envelope.columns_up_to(duration_s)
    if any(state.is_failed for state in (smallest if duration_s is None else smallest[:count])):
        return "none" if envelope.plane.magnitudes else "no"
    is_survived = not envelope.plane.magnitudes and all(s.is_without_hazard for s in smallest[:count])
    return "yes" if is_survived else "not decided"


def _short_validation(envelope: Envelope) -> str:
    if envelope.validation is None:
        return "none"
    count = count_validation(envelope, envelope.validation)
    if not count.drawn:
        return "nothing to draw"
    text = f"{count.hazardous} of {count.driven}"
    if not count.is_complete:
        return f"{text} (unfinished)"
    return f"{text} (all)" if count.is_census else f"{text} (≤ {percent_text(count.most_hazardous_share)})"


def _linked(text: str, proof: _Proof | None) -> "str | Markup":
    if proof is None or not (names := _ids_of(proof)):
        return text
    from markupsafe import Markup

    text = text.replace(" ", NO_BREAK).replace(f"{NO_BREAK}(", " (")  # may wrap only there
    return Markup('<a href="#e={}">{}</a>').format(Markup("&amp;with=").join(names), text)
