"""What a report says of a single plane: where no hazard was found, where it first fails, what shows it."""

import math
from collections.abc import Mapping

from mutator._common.message_text import SHORT_ID_LENGTH, counted
from mutator._common.phrase_texts import measured_time_text, planned_number_text
from mutator.explore.cell_results import CellResult, CellState
from mutator.explore.envelope import Envelope
from mutator.explore.envelope_failures import (
    CONFIDENCE_OF_ALL_LOOKS,
    Failure,
    ValidationCount,
    count_validation,
    disengaged_cells,
    first_failure,
    undecided_cell_count,
    undecided_results,
)
from mutator.explore.envelope_texts import (
    describe_challenge,
    fault_text,
    level_text,
    magnitude_text,
    start_text,
)

_LEVEL = f"{100 * CONFIDENCE_OF_ALL_LOOKS:g} %, for all validations of this plane together"
_MOST_REASON_LENGTH = 100


def describe_plane(envelope: Envelope, hazards: Mapping[str, str]) -> str:
    """Return up to where no hazard was found, the first failure, and how many cells were driven; `hazards`
    says what each is.
    """
    failure, undecided = first_failure(envelope), describe_undecided(envelope)
    if failure is not None:
        what = "a constant error" if envelope.is_challenged else "it"
        fails = f"{what} first fails at {_failure_text(envelope, failure, hazards)}"
        text = f"{_without_hazard_text(envelope)}; {fails}."
    elif disengaged_cells(envelope):
        text = f"{_without_hazard_text(envelope)}."
    elif undecided:
        fault = f"{fault_text(envelope)}{_up_to_largest(envelope)}"
        text = f"{fault} {_where(envelope)} is not decided: {undecided}."
    else:
        text = f"{_without_hazard_text(envelope)}."
    if undecided and (failure or disengaged_cells(envelope)):
        text += f" Not decided: {undecided}."
    return " ".join(filter(None, (text, _disengaged_text(envelope), _reach_text(envelope))))


def _disengaged_text(envelope: Envelope) -> str:
    """Return in how many runs the controller did not stay engaged; empty without any."""
    cells = disengaged_cells(envelope)
    if not cells:
        return ""
    magnitude, duration_s = envelope.magnitudes[cells[0][0]], envelope.durations_s[cells[0][1]]
    what = [magnitude_text(envelope, magnitude)] if magnitude is not None else []
    result = envelope.exploration.map.results[cells[0]]
    smallest = f"{' for '.join([*what, f'{duration_s:g} s'])}, {_short_reason(result)}"
    runs = counted(len(cells), "run")
    return (
        f"{runs} without a hazard ended with the controller disengaged or crashed (the smallest: {smallest})."
    )


def is_undecided(envelope: Envelope) -> bool:
    """Whether nothing is said of a cell whose fault leaves time to observe, or the fault was never active."""
    return undecided_cell_count(envelope) > 0 or not envelope.was_active


def describe_undecided(envelope: Envelope) -> str:
    """Return why not all cells that leave time to observe are decided; empty if they are."""
    if not envelope.was_active:
        return "the fault was never active"
    count, results = undecided_cell_count(envelope), undecided_results(envelope)
    if not count:
        return ""
    if not results:
        return f"{counted(count, 'cell')} neither driven nor between runs that agree"
    reason = _short_reason(results[0])
    verb = "has" if len(results) == 1 else "have"
    return f"{counted(len(results), 'run')} {verb} no result (the first: {reason})"


def _short_reason(result: CellResult) -> str:
    return next(iter(result.reason.splitlines()), "")[:_MOST_REASON_LENGTH].rstrip(".")


def describe_plane_validation(envelope: Envelope) -> str:
    """Return what the newest validation showed, what follows from it, and what those before it showed."""
    validation = envelope.validation
    if validation is None:
        return "Not validated."
    count = count_validation(envelope, validation)
    return f"{_last_look_text(count)}{_earlier_looks_text(envelope)}"


def _last_look_text(count: ValidationCount) -> str:
    if not count.drawn:
        return "Nothing to validate: each cell called without hazard was driven."
    drawn = counted(count.drawn, "drawn cell")
    hazardous = f"hazardous, {count.undecided} not decided" if count.undecided else "hazardous"
    hazardous += f", {count.disengaged} ended disengaged" if count.disengaged else ""
    if not count.is_complete:
        return (
            f"Validation unfinished: {count.driven} of {drawn} driven, {count.hazardous} of them {hazardous}."
        )
    if count.is_census:
        return f"{_frame_text(count)} All were drawn: {count.hazardous} of {count.drawn} {hazardous}."
    draw = f"{counted(count.drawn, 'cell')} drawn from them: {count.hazardous} {hazardous}."
    return f"{_frame_text(count)} {draw} So {_limit_text(count)}."


def _earlier_looks_text(envelope: Envelope) -> str:
    """Return what looks before the last one showed; empty without any."""
    earlier = envelope.exploration.validations[:-1]
    if not earlier:
        return ""
    counts = [count_validation(envelope, validation).hazardous for validation in earlier]
    listed = " and ".join(filter(None, (", ".join(map(str, counts[:-1])), str(counts[-1]))))
    cells = "cell, whose line was" if counts == [1] else "cells, whose lines were"
    return f" {counted(len(earlier), 'look')} before found {listed} hazardous {cells} then searched."


def _frame_text(count: ValidationCount) -> str:
    return f"The search left {counted(count.frame, 'cell')} undriven that it calls without hazard."


def _limit_text(count: ValidationCount) -> str:
    most, percent = count.most_hazardous_count, percent_text(count.most_hazardous_share)
    return f"at most {most} of these {count.frame} ({percent}) are hazardous ({_LEVEL})"


def _reach_text(envelope: Envelope) -> str:
    """Return how many cells were driven, and what the validation shows of the others."""
    size = envelope.exploration.map.lattice.size
    driven = f"{envelope.run_count:,} of {size:,} cells were driven"
    driven += f", each with {envelope.plane.seeds} seeds" if envelope.plane.seeds > 1 else ""
    validation = envelope.validation
    if not any(CellState.BETWEEN_WITHOUT in line for line in envelope.cells):
        return f"{driven}, among them each that is called without hazard."
    if validation is None:
        return f"{driven}; the others were not validated."
    count = count_validation(envelope, validation)
    if not count.is_complete:
        return f"{driven}; the validation of the others is unfinished."
    undriven = f"of the {counted(count.frame, 'cell')} that the search left undriven and calls without hazard"
    return f"{driven}, the others are inferred or between runs; {undriven}, {_limit_text(count)}."


def _where(envelope: Envelope) -> str:
    return f"in {envelope.plane.scenario} from {start_text(envelope)}"


def _up_to_largest(envelope: Envelope) -> str:
    largest = magnitude_text(envelope, envelope.magnitudes[-1])
    return f" of up to {largest}" if envelope.plane.magnitudes else ""


def _without_hazard_text(envelope: Envelope) -> str:
    """Return up to which magnitude or duration no hazard was found in a plane that has one."""
    fault, where = fault_text(envelope), _where(envelope)
    if not envelope.plane.magnitudes:
        longest_survived = envelope.longest_survived_s(0)
        if longest_survived is None:
            return f"Not even the shortest duration of {fault} {where} is called without hazard"
        return f"No hazard of {fault} was found {where} for up to {longest_survived:g} s"
    survived = envelope.largest_survived()
    if survived is None:
        smallest = f"Not even the smallest magnitude of {fault} {where}"
        return f"{smallest} is called without hazard for every duration"
    return _without_hazard_if_challenged(envelope, magnitude_text(envelope, survived))


def _without_hazard_if_challenged(envelope: Envelope, largest: str) -> str:
    """Return what is left of `largest`, which is survived of a constant error, after its challengers."""
    fault, where = fault_text(envelope), _where(envelope)
    longest = f"for up to {planned_number_text(envelope.longest_tried_s, 's')}"
    challenge = envelope.challenged()
    if challenge is None or not challenge.is_complete:
        return f"No hazard of {fault} of up to {largest} was found {where}, {longest}"
    if not challenge.is_lowered:
        return f"No hazard of {fault} of up to {largest}, constant or changing, was found {where}, {longest}"
    least = level_text(envelope, challenge)
    text = (
        f"Not even the smallest magnitude of {fault} {where} survives all challengers"
        if challenge.level is None
        else f"No hazard of {fault} of up to {least}, constant or changing, was found {where}, {longest}"
    )
    return f"{text} ({describe_challenge(envelope, challenge)})"


def _failure_text(envelope: Envelope, failure: Failure, hazards: Mapping[str, str]) -> str:
    what = [magnitude_text(envelope, failure.magnitude)] if failure.magnitude is not None else []
    what.append(f"{failure.duration_s:g} s")
    name, time_s = failure.result.hazard, failure.result.time_to_hazard_s or 0.0
    about = hazards.get(name, "").rstrip(".")
    hazard = f"{name}, {about[:1].lower()}{about[1:]}," if about else name
    run = failure.result.experiment_id[:SHORT_ID_LENGTH]
    how = {
        CellState.INFERRED: f"inferred from run {run}: ",
        CellState.BETWEEN_HAZARDOUS: f"not driven, between runs; the nearest with a hazard is {run}: ",
    }.get(failure.state, "")
    return f"{' for '.join(what)} ({how}{hazard} after {measured_time_text(time_s)})"


def percent_text(share: float) -> str:
    """Return the share in percent, rounded up to two digits."""
    percent = 100 * share
    digits = 1 - math.floor(math.log10(percent)) if percent else 0
    factor = 10.0**digits
    return f"{math.ceil(round(percent * factor, 6)) / factor:g} %"
