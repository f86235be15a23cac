"""Pairs of one experiment without and with a set of defences, and what became of its hazard."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from mutator.model import Status
from mutator.results.columns_of_defences import (
    AFTER_FAULT,
    AUTHORITY_PREFIX,
    CONFLICTS,
    DEFENCE,
    DRIVER_AT_END,
    END_SPEED,
    FIRST_ACTED,
)
from mutator.results.result_rows import ResultRow

STANDSTILL_MPS = 0.3  # below this, a car stands: as in openpilot, and in the hazards of the shipped target
LEAST_DELTA_V_CHANGE_MPS = 0.1  # a smaller change of a contact is none


class PairOutcome(StrEnum):
    """What became of an experiment's hazard with defences: `PAIR_OUTCOME_MEANINGS` says what each means."""

    PREVENTED = "prevented"
    OPEN = "open"
    REPLACED = "replaced"
    MITIGATED = "mitigated"
    UNCHANGED = "unchanged"
    WORSENED = "worsened"
    CAUSED = "caused"
    NO_HAZARD = "no_hazard"
    NOT_COMPARED = "not_compared"

    @property
    def words(self) -> str:
        return self.value.replace("_", " ")


PAIR_OUTCOME_MEANINGS = {
    PairOutcome.PREVENTED: "no hazard until the end, and at the end the fault is over for the campaign's "
    "`observe_s`, the car stands, or a driver has it",
    PairOutcome.OPEN: "no hazard either, but the drive ends too early to call it prevented",
    PairOutcome.REPLACED: "another hazard instead; this is never prevented",
    PairOutcome.MITIGATED: "the same hazard, less severe; or as severe, with fewer others",
    PairOutcome.UNCHANGED: "the same hazards, as severe",
    PairOutcome.WORSENED: "the same hazard, more severe; or as severe, with more others",
    PairOutcome.CAUSED: "a hazard in an experiment that has none without the defences",
    PairOutcome.NO_HAZARD: "no hazard, without and with the defences",
    PairOutcome.NOT_COMPARED: "one of the two runs crashed, or has no result",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DefendedRow:
    """What a defended run adds to its row.

    * `acted`: the defences that acted; `first_acted_s`: when one first did, in s; None if none did
    * `conflict_steps`: steps in which two disagreed
    * `after_fault_s`: how long the drive went on after the fault; None if it was never active
    * `end_speed`: in m/s, at the end of the drive; None if it is not known
    * `driver_at_end`: whether a driver acted in the last step
    * `authority`: by command, the value furthest from 0 that a defence commanded
    """

    acted: tuple[str, ...]
    conflict_steps: int
    after_fault_s: float | None
    end_speed: float | None
    driver_at_end: bool
    authority: Mapping[str, float]
    first_acted_s: float | None = None

    @classmethod
    def of_cells(cls, cells: Mapping[str, Any]) -> "DefendedRow":
        """Return what the cells of a row of results say."""
        return cls(
            acted=tuple(filter(None, (cells[DEFENCE] or "").split(";"))),
            first_acted_s=cells[FIRST_ACTED],
            conflict_steps=int(cells[CONFLICTS] or 0),
            after_fault_s=cells[AFTER_FAULT],
            end_speed=cells[END_SPEED],
            driver_at_end=bool(cells[DRIVER_AT_END]),
            authority={
                column.removeprefix(AUTHORITY_PREFIX): value
                for column, value in cells.items()
                if column.startswith(AUTHORITY_PREFIX) and value is not None
            },
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DefendedPair:
    """An experiment without and with a set of defences. The hazards of `defended` are also those that its
    defences cause without a fault.
    """

    undefended: ResultRow
    defended: ResultRow
    facts: DefendedRow
    outcome: PairOutcome

    @property
    def is_unneeded_activation(self) -> bool:
        """Whether a defence acted although the undefended run has no hazard."""
        return bool(self.facts.acted) and self.outcome in (PairOutcome.NO_HAZARD, PairOutcome.CAUSED)

    @property
    def what_became(self) -> str:
        """What became of the experiment, in words: `prevented`, `replaced by H4`, `caused H4`."""
        hazards = ", ".join(name for name, _ in self.defended.hazards)
        if self.outcome is PairOutcome.REPLACED:
            return f"replaced by {hazards}"
        return f"caused {hazards}" if self.outcome is PairOutcome.CAUSED else self.outcome.words


def pair_of(undefended: ResultRow, defended: ResultRow, facts: DefendedRow, observe_s: float) -> DefendedPair:
    """Return the pair of two rows of one experiment. `observe_s`: how long a drive must go on after its fault
    for its hazard to count as prevented.
    """
    outcome = _outcome_of(undefended, defended, facts, observe_s)
    return DefendedPair(undefended=undefended, defended=defended, facts=facts, outcome=outcome)


def _outcome_of(
    undefended: ResultRow, defended: ResultRow, facts: DefendedRow, observe_s: float
) -> PairOutcome:
    if not (_is_complete(undefended) and _is_complete(defended)):
        return PairOutcome.NOT_COMPARED
    before, after = ({name for name, _ in row.hazards} for row in (undefended, defended))
    if not before:
        return PairOutcome.CAUSED if after else PairOutcome.NO_HAZARD
    if not after:
        return PairOutcome.PREVENTED if _is_over(facts, observe_s) else PairOutcome.OPEN
    if not before & after:
        return PairOutcome.REPLACED
    harm = _added_harm(undefended, defended) or len(after - before) or -len(before - after)
    if not harm:
        return PairOutcome.UNCHANGED
    return PairOutcome.WORSENED if harm > 0 else PairOutcome.MITIGATED


def _is_complete(row: ResultRow) -> bool:
    """Whether the run went to its end. One that was not judged, because its golden run has a hazard before
    the fault, is compared by the hazards that the defences cause.
    """
    return row.status is Status.OK and (row.usable or bool(row.hazards))


def _is_over(facts: DefendedRow, observe_s: float) -> bool:
    """Whether nothing can follow: the fault is long over, the car stands, or a driver has it."""
    if facts.driver_at_end or (facts.end_speed is not None and abs(facts.end_speed) < STANDSTILL_MPS):
        return True
    return facts.after_fault_s is not None and facts.after_fault_s >= observe_s


def _added_harm(undefended: ResultRow, defended: ResultRow) -> float:
    """Return a number above 0 if the defended run is more severe, below 0 if it is less severe: by severity
    class, then by the change of speed in the contact.
    """
    if undefended.severity != defended.severity:
        return 1.0 if undefended.severity < defended.severity else -1.0
    if undefended.delta_v is None or defended.delta_v is None:
        return 0.0
    change = defended.delta_v - undefended.delta_v
    return change if abs(change) >= LEAST_DELTA_V_CHANGE_MPS and math.isfinite(change) else 0.0
