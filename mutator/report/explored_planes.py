"""What a report says of an exploration: its envelopes, worst first, in sentences and a table."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from mutator._common.message_text import counted
from mutator._common.phrase_texts import measured_time_text, planned_number_text
from mutator._common.table_rendering import TextTable
from mutator.errors import MutatorError
from mutator.explore.envelope import BoundaryPair, Envelope
from mutator.explore.envelope_failures import (
    CONFIDENCE_OF_EACH_LOOK,
    Failure,
    count_validation,
    first_failure,
    hazardous_share,
)
from mutator.explore.envelope_texts import TABLE_DURATIONS_S, fault_text, magnitude_text, start_text
from mutator.explore.exploration_replay import ExplorationReplay, is_exploration, replay_exploration
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
    "up to",
    "hazard after",
    "validation",
    "runs of cells",
)
NO_PROBABILITY_NOTE = (
    "Nothing here is a probability on the road: a search chose the runs, so no share of them, here or below, "
    "says how often faults or hazards occur."
)
TABLE_NOTE = (
    "“Survived” is the largest magnitude of a constant error of this kind up to which no cell has a hazard, "
    "at this start in this scenario; an error that changes can be worse. “Up to” and “hazard after” are of "
    "the largest magnitude tried: up to which duration no cell has a hazard, and the time from the start of "
    "the longest fault to its hazard. Links open the first run with a hazard beside a shorter one without."
)


@dataclass(frozen=True, kw_only=True)
class ExploredPlanes:
    """The envelopes of a run, worst first: planes of one fault together, by their share of hazardous cells.

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
            replay = replay_exploration(folder, workspace.manifest(folder.head.target))
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
        share_by_spec: dict[str, float] = {}
        shares = [(envelope, hazardous_share(envelope)) for envelope in envelopes]
        for envelope, share in shares:
            spec = envelope.plane.spec
            share_by_spec[spec] = max(share, share_by_spec.get(spec, 0.0))
        shares.sort(key=lambda pair: (-share_by_spec[pair[0].plane.spec], pair[0].plane.spec, -pair[1]))
        return cls(envelopes=[envelope for envelope, _ in shares], hazards=hazards)

    def first_sentence(self) -> str:
        """Return what the worst plane survives and where it first fails."""
        if not self.envelopes:
            return self.problem or "Nothing was driven yet."
        return _first_sentence(self.envelopes[0], self.hazards)

    def describe_all(self) -> str:
        """Return how many planes there are, and how many are without any hazard; empty for a single one."""
        safe = sum(first_failure(envelope) is None for envelope in self.envelopes)
        count = len(self.envelopes)
        if count < 2:
            return ""
        if safe == count:
            return f"No hazard was found in any of the {count} planes."
        safe_text = f"in {safe} of them no hazard was found" if safe else "each has a hazard"
        return f"That is the worst of {count} planes; {safe_text}."

    @property
    def linked_ids(self) -> set[str]:
        """The ids of the experiments to which the table has links."""
        proofs = (proof for envelope in self.envelopes for proof in _proofs(envelope))
        return {name for proof in proofs if proof for name in _ids_of(proof)}

    def table(self, *, with_links: bool) -> TextTable:
        """Return a row for each envelope; with links for the page, not for Markdown."""
        rows = [_row(envelope, with_links=with_links) for envelope in self.envelopes]
        return TextTable(heads=_TABLE_HEADS, rows=rows, right_aligned=range(3, 10))


def describe_plane_validation(envelope: Envelope) -> str:
    """Return what the newest validation found, and what follows from it."""
    validation = envelope.validation
    if validation is None:
        return "Not validated."
    count = count_validation(envelope, validation)
    if not count.drawn:
        return "Nothing to validate: each cell called without hazard was driven."
    drawn = counted(count.drawn, "drawn cell")
    hazardous = f"hazardous, {count.undecided} not decided" if count.undecided else "hazardous"
    if not count.is_complete:
        return (
            f"Validation unfinished: {count.driven} of {drawn} driven, {count.hazardous} of them {hazardous}."
        )
    if count.is_census:
        return f"{count.hazardous} of {drawn} {hazardous}: these are all cells called without hazard."
    percent = _percent_text(count.most_hazardous_share)
    level = f"{100 * CONFIDENCE_OF_EACH_LOOK:g} % for each look"
    return (
        f"{count.hazardous} of {drawn} {hazardous}: at most {percent} of the cells called without hazard are "
        f"hazardous ({level})."
    )


def _first_sentence(envelope: Envelope, hazards: Mapping[str, str]) -> str:
    where = f"in {envelope.plane.scenario} from {start_text(envelope)}"
    fault, largest = fault_text(envelope), magnitude_text(envelope, envelope.magnitudes[-1])
    longest = planned_number_text(envelope.longest_tried_s, "s")
    failure, survived = first_failure(envelope), envelope.largest_survived()
    if failure is None:
        of = f" of up to {largest}" if envelope.plane.magnitudes else ""
        if survived == envelope.magnitudes[-1] and _is_survived_whole(envelope):
            return f"The controller survives {fault}{of} {where} for every duration tried, up to {longest}."
        return f"No hazard of {fault}{of} was found {where}, but not all of its cells are decided."
    if not envelope.plane.magnitudes:
        longest_survived = envelope.longest_survived_s(0)
        survives = f"{fault} {where} for " + (
            f"up to {longest_survived:g} s" if longest_survived else "no duration tried"
        )
    elif survived is None:
        survives = f"no magnitude tried of {fault} {where} for every duration up to {longest}"
    else:
        survives = (
            f"{fault} of up to {magnitude_text(envelope, survived)} {where} for every duration tried, "
            f"up to {longest}"
        )
    return (
        f"The controller survives {survives}; it first fails at {_failure_text(envelope, failure, hazards)}."
    )


def _is_survived_whole(envelope: Envelope) -> bool:
    count = envelope.columns_up_to()
    return all(state.is_without_hazard for line in envelope.cells for state in line[:count])


def _failure_text(envelope: Envelope, failure: Failure, hazards: Mapping[str, str]) -> str:
    what = [magnitude_text(envelope, failure.magnitude)] if failure.magnitude is not None else []
    what.append(f"{failure.duration_s:g} s")
    name, time_s = failure.result.hazard, failure.result.time_to_hazard_s or 0.0
    about = hazards.get(name, "").rstrip(".")
    hazard = f"{name}, {about[:1].lower()}{about[1:]}," if about else name
    return f"{' for '.join(what)} ({hazard} after {measured_time_text(time_s)})"


def _proofs(envelope: Envelope) -> list[Failure | BoundaryPair | None]:
    """Return what a row links: the first failure for every duration and for those of the table, and the
    border of the largest magnitude.
    """
    failures = [first_failure(envelope, duration) for duration in (None, *TABLE_DURATIONS_S)]
    return [*failures, envelope.boundary_pair(len(envelope.magnitudes) - 1)]


def _ids_of(proof: Failure | BoundaryPair) -> list[str]:
    """Return the id of the run with a hazard and, if there is one, of its neighbour without."""
    if isinstance(proof, BoundaryPair):
        return [proof.hazardous.experiment_id, proof.without_hazard.experiment_id]
    neighbour = [proof.neighbour.experiment_id] if proof.neighbour else []
    return [proof.result.experiment_id, *neighbour]


def _row(envelope: Envelope, *, with_links: bool) -> list[str]:
    last = len(envelope.magnitudes) - 1
    longest, time_s = envelope.longest_survived_s(last), envelope.time_to_hazard_s(last)
    linked = [
        *(_survived_text(envelope, duration) for duration in (None, *TABLE_DURATIONS_S)),
        "none" if longest is None else f"{longest:g} s",
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
        _short_validation(envelope),
        f"{envelope.run_count} of {envelope.exploration.map.lattice.size:,}",
    ]


def _survived_text(envelope: Envelope, duration_s: float | None) -> str:
    """Return the largest magnitude that is survived; `yes` or `no` for a fault without a value."""
    survived = envelope.largest_survived(duration_s)
    if survived is not None:
        return magnitude_text(envelope, survived)
    if duration_s is not None and duration_s > envelope.durations_s[-1]:
        return "not tried"
    smallest, count = envelope.cells[0], envelope.columns_up_to(duration_s)
    if any(state.is_hazardous for state in (smallest if duration_s is None else smallest[:count])):
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
    return f"{text} (all)" if count.is_census else f"{text} (≤ {_percent_text(count.most_hazardous_share)})"


def _percent_text(share: float) -> str:
    """Return the share in percent, rounded up to two digits."""
    percent = 100 * share
    digits = 1 - math.floor(math.log10(percent)) if percent else 0
    factor = 10.0**digits
    return f"{math.ceil(round(percent * factor, 6)) / factor:g} %"


def _linked(text: str, proof: Failure | BoundaryPair | None) -> "str | Markup":
    if proof is None:
        return text
    from markupsafe import Markup

    return Markup('<a href="#e={}">{}</a>').format(Markup("&amp;with=").join(_ids_of(proof)), text)
