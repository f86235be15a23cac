"""The sentence about an experiment: what was injected, what the car did, what followed, whether anybody was
warned.

It follows from the experiment's row in the results, its fault and the phrases that the run stores. What a row
lacks is left out, never guessed. Times have hundredths, as in tables, so that both show the same number.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from mutator._common.phrase_texts import (
    fill_phrase,
    holes_of,
    measured_number_text,
    measured_time_text,
    planned_number_text,
)
from mutator.model import AgainstGolden, Fault, Hold, Outcome, Status
from mutator.results.columns_of_golden_hazards import AGAINST_GOLDEN
from mutator.results.fault_phrases import describe_fault
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_phrases import (
    FIRST_CHANGE_SHARE,
    GOLDEN_HIGHEST_SPEED,
    GOLDEN_LOWEST_SPEED,
    HIGHER,
    HIGHEST_SPEED,
    LATER_HOLE,
    LOWER,
    LOWEST_SPEED,
    NO_NUMBER,
    SPEED_AT_ACTIVATION,
    PhraseByCase,
    Phrases,
)
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN, HazardFacts, hazard_facts
from mutator.triggers.trigger_kinds import name_without_hold

if TYPE_CHECKING:
    from mutator.store.run_head import RunHead

ResultCells = Mapping[str, Any]  # cells by column; None, NaN or '': no value

_LEAST_SPEED_CHANGE_MPS = 0.5  # a smaller one is not worth a word
_LEAST_SHARE_OF_WHOLE = 0.75  # of a deviation: with less in one direction, a sentence names both
_TIME_CONDITION_PATTERN = re.compile(r"t >= ([0-9.]+)\Z")
_SUBJECT_PATTERN = re.compile(r"(the \w+) ")
_SENTENCE_BY_FAILED_STATUS = {
    Status.CRASHED: "The controller crashes",
    Status.TIMEOUT: "The run was stopped at a limit",
    Status.INVALID_MUTANT: "The mutant cannot run",
    Status.HARNESS_ERROR: "The harness failed, so nothing is known about the fault",
    Status.LEFT_OUT: "It was left out",
}
_SENTENCE_BY_GOLDEN_CASE = {
    AgainstGolden.ANOTHER: "The golden run has a hazard, too, but another one.",
    AgainstGolden.EARLIER: "The golden run has a hazard, too, but later.",
    AgainstGolden.WORSE: "The golden run has a hazard, too, but a milder one.",
    AgainstGolden.MISSING: "A hazard of the golden run does not come.",
    AgainstGolden.LATER: "The hazard of the golden run comes later.",
    AgainstGolden.SAME: "The hazard of the golden run comes as without the fault.",
}


@dataclass(frozen=True, kw_only=True)
class ExperimentSentences:
    """Writes the sentences about the experiments of a run, or of a target."""

    phrases: Phrases
    hazards: Sequence[HazardFacts]
    unit_by_metric: Mapping[str, str]
    has_alerts: bool
    words_by_severity: Mapping[str, str]

    @classmethod
    def of_run(cls, head: "RunHead") -> "ExperimentSentences":
        """Return the writer for a run, from what the run stores."""
        hazards = head.about_hazards or [
            HazardFacts(name=name, about="", terminal=False) for name in head.hazards
        ]
        units = {metric.name: metric.unit for metric in head.metrics}
        return cls(
            phrases=head.phrases,
            hazards=hazards,
            unit_by_metric=units,
            has_alerts=bool(head.alerts),
            words_by_severity=dict(head.severity.words) if head.severity else {},
        )

    @classmethod
    def of_target(
        cls, manifest: TargetManifest, phrases: Phrases, scale: SeverityScale | None
    ) -> "ExperimentSentences":
        """Return the writer for runs of a target outside a campaign."""
        units = {metric.name: metric.unit for metric in manifest.all_metrics}
        return cls(
            phrases=phrases,
            hazards=hazard_facts(manifest),
            unit_by_metric=units,
            has_alerts=bool(manifest.alerts),
            words_by_severity=dict(scale.words) if scale else {},
        )

    def fault_clause(self, fault: Fault) -> str:
        """Return what a fault does, without a drive: `the speed sensor reads 50 mph too low`."""
        return describe_fault(fault, self.phrases)

    def sentence(self, row: ResultCells, fault: Fault) -> str:
        """Return the sentence about the experiment of a row."""
        status = Status(row["status"])
        injected = self._fault_sentence(fault, row)
        if status is not Status.OK:
            parts = [injected, _failure_sentence(status, row)]
        elif row["outcome"] == Outcome.NOT_ACTIVATED:
            parts = [injected, _why_not_active(row)]
        elif row["outcome"] == Outcome.NOT_JUDGED:
            parts = [injected, f"It cannot be judged: {row.get('detail')}."]
        else:
            golden_case = row.get(AGAINST_GOLDEN) or ""
            against_golden = _SENTENCE_BY_GOLDEN_CASE[AgainstGolden(golden_case)] if golden_case else ""
            parts = [injected, self._effect(row), against_golden, *self._consequences(row)]
        return " ".join(filter(None, parts))

    def _fault_sentence(self, fault: Fault, row: ResultCells) -> str:
        """Say what was injected and when it was active; if it never was, what was planned."""
        clause = self.fault_clause(fault)
        is_name = clause == fault.label  # a name keeps its letters
        begin, situation = _number_in_row(row, "t_activation"), self._situation_clause(row)
        if begin is not None:
            text = f"{clause} from {measured_time_text(begin)}{situation}"
            return f"{text}." if is_name else _as_sentence(text)
        planned = clause if is_name else _decapitalized(clause)
        context = self._context_phrase(row)
        begin_clause = "" if context and context in situation else _planned_begin_clause(row)
        return f"Planned: {planned}{begin_clause}{situation}."

    def _situation_clause(self, row: ResultCells) -> str:
        """` for 2 s`, ` while the car is close behind a slower vehicle`; '' for a fault that stays."""
        hold, condition = row.get("hold") or "", str(row.get("condition") or "")
        context = self._context_phrase(row)
        if hold == Hold.FOR:
            seconds = _number_in_row(row, "hold_s")
            start = f", starting {context}" if context else ""
            return "" if seconds is None else f" for {planned_number_text(seconds, 's')}{start}"
        if hold != Hold.WHILE or condition == "True" or _TIME_CONDITION_PATTERN.match(condition):
            return ""
        return f" {context or f'while {condition}'}"

    def _context_phrase(self, row: ResultCells) -> str:
        """Return the phrase of the context that triggers the fault, also for a hold; '' without one."""
        name = name_without_hold(str(row.get("trigger") or ""), _number_in_row(row, "hold_s"))
        return fill_phrase(self.phrases.situations.get(name, {}).get("", ()), {})

    def _effect(self, row: ResultCells) -> str:
        """Say what the car did, and which hazards followed."""
        hazards = self._hazard_times(row)
        if row["outcome"] == Outcome.MASKED:
            return _where_stopped(row)
        has_hazard = bool(hazards)
        clauses = (
            []
            if _changed_only_after_hazard(row, hazards)
            else [
                self._actuator_clause(row, has_hazard=has_hazard),
                self._speed_clause(row, has_hazard=has_hazard),
            ]
        )
        before = _number_in_row(row, "t_activation")
        for hazard, time in hazards:
            clauses.append(self._hazard_clause(hazard, time, before, row, is_first=hazard == hazards[0][0]))
            before = time
        text = _as_sentence(_joined_clauses(list(filter(None, clauses))))
        if not has_hazard:
            return f"{text} {_no_hazard(row)}".strip()
        severity_class = row.get("severity") or ""
        if not severity_class:
            return text
        words = self.words_by_severity.get(severity_class)
        if len(hazards) > 1:
            return f"{text} Severity: {words or severity_class}."
        return f"{text[:-1]} ({words or f'severity {severity_class}'})."

    def _hazard_times(self, row: ResultCells) -> list[tuple[HazardFacts, float]]:
        times = [(hazard, _number_in_row(row, f"t_{hazard.name.lower()}")) for hazard in self.hazards]
        return sorted(((h, t) for h, t in times if t is not None), key=lambda item: item[1])

    def _actuator_clause(self, row: ResultCells, *, has_hazard: bool) -> str:
        """Say what the first actuator did. A direction that does not hold for the whole is only the first.

        What follows it is a speed if there is one, even of a car that then stands: another actuator may have
        stopped it.
        """
        name, change = row.get("first_actuator") or "", row.get("first_change") or ""
        if not (name and change):
            return ""
        if change == NO_NUMBER:
            return f"`{name}` becomes NaN"
        opposite, speeds = LOWER if change == HIGHER else HIGHER, _speed_texts(row, has_hazard=has_hazard)
        clause = self._change_clause(name, change, {})
        if (with_speed := self._change_clause(name, change, speeds)) != clause:
            return with_speed
        then = self._change_clause(name, opposite, _speed_texts(row, has_hazard=False))
        share = _number_in_row(row, FIRST_CHANGE_SHARE)
        if share is not None and share < _LEAST_SHARE_OF_WHOLE:
            return f"{clause} at first, then {_without_subject(then, clause)}"
        is_contrary = then != self._change_clause(name, opposite, {})  # the car's speed changed that way
        return f"{clause} at first" if is_contrary else clause

    def _speed_clause(self, row: ResultCells, *, has_hazard: bool) -> str:
        """Say how the speed changed if the first actuator's phrases cannot: `the car slows to 5 m/s`. If it
        changed both ways, the larger change.
        """
        speeds = _speed_texts(row, has_hazard=has_hazard)
        first_phrase = self.phrases.actuators.get(row.get("first_actuator") or "", {})
        if not speeds or not first_phrase or any(map(holes_of, _texts_of(first_phrase))):
            return ""
        name = next(iter(speeds))
        texts = [text for phrase in self.phrases.actuators.values() for text in _texts_of(phrase)]
        return fill_phrase([text for text in texts if name in holes_of(text)], speeds)

    def _change_clause(self, name: str, change: str, speeds: Mapping[str, str]) -> str:
        phrase = self.phrases.actuators.get(name, {}).get(change, ())
        return fill_phrase(phrase, speeds) or f"`{name}` is {change} than in the golden run"

    def _hazard_clause(
        self, hazard: HazardFacts, time: float, before: float | None, row: ResultCells, *, is_first: bool
    ) -> str:
        later = _describe_delay(time, before, is_first=is_first)
        metrics = {name: _number_in_row(row, name) for name in self.unit_by_metric}
        if hazard.terminal and _number_in_row(row, DRIVE_END_COLUMN) != time:
            metrics = {}  # they were measured up to another end of the drive
        values = {
            name: measured_number_text(value, self.unit_by_metric[name])
            for name, value in metrics.items()
            if value is not None
        }
        phrase = self.phrases.hazards.get(hazard.name, {}).get("", ())
        text = fill_phrase(phrase, values | {LATER_HOLE: later})
        about = f" ({hazard.about})" if hazard.about else ""
        return text or f"hazard {hazard.name}{about} occurs {later}"

    def _consequences(self, row: ResultCells) -> list[str]:
        return [_alert_sentence(row, self._hazard_times(row))] if self.has_alerts else []


def _texts_of(phrase: PhraseByCase) -> list[str]:
    return [text for texts in phrase.values() for text in texts]


def _number_in_row(row: ResultCells, name: str) -> float | None:
    value = row.get(name)
    return None if value is None or value == "" or value != value else float(value)


def _as_sentence(clause: str) -> str:
    return f"{clause[0].upper()}{clause[1:]}." if clause else ""


def _decapitalized(clause: str) -> str:
    return clause[0].lower() + clause[1:] if clause[1:2].islower() else clause


def _planned_begin_clause(row: ResultCells) -> str:
    """` from 24.60 s`, ` once gap < 30`; '' for a fault that is active while a condition holds."""
    condition = str(row.get("condition") or "")
    if time := _TIME_CONDITION_PATTERN.match(condition):
        return f" from {measured_time_text(float(time[1]))}"
    return "" if row.get("hold") == Hold.WHILE or condition in ("", "True") else f" once {condition}"


def _failure_sentence(status: Status, row: ResultCells) -> str:
    detail = str(row.get("detail") or "").rstrip(".")
    return f"{_SENTENCE_BY_FAILED_STATUS[status]}{f': {detail}' if detail else ''}."


def _why_not_active(row: ResultCells) -> str:
    if detail := str(row.get("detail") or ""):
        return f"It was never active: {detail}."
    when = "then" if row.get("hold") == Hold.TO_END else "at any such time"
    return f"It was never active: the changed code did not run {when}."


def _where_stopped(row: ResultCells) -> str:
    places = str(row.get("stopped_at") or "").replace(";", " and ")
    return f"It changes no actuator{f': it stops at {places}' if places else ''}. {_no_hazard(row)}".strip()


def _no_hazard(row: ResultCells) -> str:
    return "" if row.get(AGAINST_GOLDEN) else "No hazard follows."


def _changed_only_after_hazard(row: ResultCells, hazards: Sequence[tuple[HazardFacts, float]]) -> bool:
    """Whether the first hazard came before an actuator differed."""
    manifested = _number_in_row(row, "t_manifest")
    return bool(hazards) and (manifested is None or manifested > hazards[0][1])


def _speed_texts(row: ResultCells, *, has_hazard: bool) -> dict[str, str]:
    """Return the highest speed if the fault made the car faster, the lowest if it made it slower; the larger
    change first.

    The lowest speed before a hazard is left out if the car then stands: `slows to 0.29 m/s and stops`.
    """
    start = _number_in_row(row, SPEED_AT_ACTIVATION)
    changes = {}
    for name, golden_name, sign in (
        (HIGHEST_SPEED, GOLDEN_HIGHEST_SPEED, 1.0),
        (LOWEST_SPEED, GOLDEN_LOWEST_SPEED, -1.0),
    ):
        speed, golden = _number_in_row(row, name), _number_in_row(row, golden_name)
        if start is not None and speed is not None and golden is not None:
            changes[name] = min(sign * (speed - start), sign * (speed - golden)), speed
    if has_hazard and (_number_in_row(row, LOWEST_SPEED) or 0.0) < _LEAST_SPEED_CHANGE_MPS:
        changes.pop(LOWEST_SPEED, None)
    larger_first = sorted(changes.items(), key=lambda change: -change[1][0])
    return {
        name: measured_number_text(speed, "m/s")
        for name, (gain, speed) in larger_first
        if gain >= _LEAST_SPEED_CHANGE_MPS
    }


def _describe_delay(time: float, before: float | None, *, is_first: bool) -> str:
    """`4.52 s later`; after another hazard, `4.52 s after that`."""
    if before is None:
        return f"at {measured_time_text(time)}"
    gap = round(time - before, 6)
    if gap <= 0.0:
        return "at once" if is_first else "at the same time"
    return f"{measured_time_text(gap)} {'later' if is_first else 'after that'}"


def _joined_clauses(clauses: Sequence[str]) -> str:
    """Join clauses. One with the subject of the clause before loses it: `the car slows and stops`."""
    shortened = list(clauses[:1])
    shortened += [_without_subject(clause, before) for before, clause in pairwise(clauses)]
    return " and ".join(filter(None, (", ".join(shortened[:-1]), *shortened[-1:])))


def _without_subject(clause: str, before: str) -> str:
    """Return a clause without its subject if that is the subject of the clause before."""
    subject, earlier = _SUBJECT_PATTERN.match(clause), _SUBJECT_PATTERN.match(before)
    is_same = subject and earlier and subject[1] == earlier[1]
    return clause[len(subject[0]) :] if subject and is_same else clause


def _alert_sentence(row: ResultCells, hazards: Sequence[tuple[HazardFacts, float]]) -> str:
    """`No alert.`, or when the first alert came, relative to the first hazard."""
    time, name = _number_in_row(row, "t_alert"), str(row.get("alerts") or "").split(";")[0]
    if time is None:
        return "No alert."
    if not hazards:
        return f"Alert {name} at {measured_time_text(time)}."
    ahead = round(hazards[0][1] - time, 6)
    hazard = "the hazard" if len(hazards) == 1 else "the first hazard"
    if ahead == 0.0:
        return f"Alert {name} only in the moment of {hazard}."
    gap = measured_time_text(abs(ahead))
    return (
        f"Alert {name} {gap} before {hazard}." if ahead > 0.0 else f"Alert {name} only {gap} after {hazard}."
    )
