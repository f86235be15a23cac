"""The search for the smallest form of a fault with the same hazard.

Each proposal depends on the results of earlier ones alone. A form is simpler if something in it is simpler
and nothing else is worse: a shorter or smaller fault, one injection, a simpler scenario. A hazard is monotone
in none of these, so the search ends only when the next smaller fault and the next shorter one were driven,
and came out without the hazard.
"""

from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from mutator.explore.fault_forms import Axis, FaultForm, FormResult, FormSpace
from mutator.explore.round_numbers import RoundNumbers

_BATCH = 2  # forms that are driven together: few, because the first result often makes the other needless
# Up to the hazard, a longer fault does the same. The fault's last step acts on the truth of the next one.
_STEPS_AFTER_HAZARD = 2
_START_DIGITS = (1, 2, 3)

_Results: TypeAlias = Mapping[FaultForm, FormResult]
Proposals: TypeAlias = Generator[list[FaultForm], _Results, None]
_Choice: TypeAlias = Generator[list[FaultForm], _Results, FaultForm]
_Driven: TypeAlias = Generator[list[FaultForm], _Results, list[FaultForm]]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShrinkingStep:
    """What became simpler, and the form then."""

    what: str
    form: FaultForm


@dataclass(slots=True)
class Shrinking:
    """Looks for the smallest form. `proposals` yields the forms to drive, and takes their results."""

    space: FormSpace
    smallest: FaultForm = field(init=False)
    results: dict[FaultForm, FormResult] = field(default_factory=dict)
    steps: list[ShrinkingStep] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.smallest = self.space.original

    def proposals(self) -> Proposals:
        """Yield lists of forms to drive; each takes its results by form."""
        window = "start" if self.space.longest_s is None else "duration"
        yield from self._note(window, self._window())
        yield from self._note("scenario", self._simpler_scenario())
        yield from self._note("injections", self._single_injection())
        yield from self._note("size", self._smaller(Axis.SIZE))
        if self.space.changes_start:
            yield from self._note("start", self._rounder_start())
        yield from self._note("duration", self._shortened_by_causality())
        yield from self._note("duration", self._smaller(Axis.DURATION))
        yield from self._note("size and duration", self._without_smaller_neighbour())

    def neighbour(self, form: FaultForm, axis: Axis, count: int = 1) -> FaultForm | None:
        """Return the `count`-th smaller form on an axis; None if there is none."""
        numbers, number = self._numbers(axis), form.number(axis)
        if numbers is None or number is None or (smaller := numbers.below(number, count)) is None:
            return None
        return form.with_number(axis, smaller)

    def hazard_s(self, form: FaultForm) -> float | None:
        """Return when the hazard came in a form, driven or original; None without it."""
        return self.space.hazard_s if form == self.space.original else self.results[form].hazard_s

    def _note(self, what: str, choice: _Choice) -> Proposals:
        form = yield from choice
        if form != self.smallest:
            self.smallest = form
            self.steps.append(ShrinkingStep(what=what, form=form))

    def _drive(self, forms: Iterable[FaultForm]) -> _Driven:
        """Drive forms without a result; return all those with the hazard, in order."""
        listed = list(dict.fromkeys(forms))
        undriven = [form for form in listed if form not in self.results and form != self.space.original]
        if undriven:
            self.results.update((yield undriven))
        return [form for form in listed if self.hazard_s(form) is not None]

    def _window(self) -> _Choice:
        """Give the fault a start and a duration of its own, as short as causality allows."""
        space, form = self.space, self.smallest
        if space.longest_s is None and not space.can_start_at_time:
            return form
        at_time = replace(form, start_s=space.start_s)
        if space.longest_s is None:
            candidates: Sequence[FaultForm] = [at_time]
        else:
            ends_s = (space.hazard_s, min(space.hazard_s, space.last_active_s))
            durations = sorted({self._duration_until(end_s) for end_s in ends_s})
            candidates = [replace(at_time, duration_s=duration) for duration in durations]
        hazardous = yield from self._drive(candidates)
        if not hazardous and space.longest_s is not None:
            hazardous = yield from self._drive([replace(at_time, duration_s=space.longest_s)])
        if hazardous:
            return hazardous[0]
        self.notes.append(
            "the fault keeps its trigger: active without a break from its first moment, it has another result"
        )
        return form

    def _duration_until(self, time_s: float) -> float:
        space = self.space
        needed_s = time_s - space.start_s + _STEPS_AFTER_HAZARD * space.step_s
        longest_s = space.longest_s
        shortest = space.durations.at_least(round(needed_s, 9))
        return shortest if longest_s is None else min(shortest, longest_s)

    def _simpler_scenario(self) -> _Choice:
        names = self.space.scenarios
        for first in range(0, len(names), _BATCH):
            in_scenarios = (self._in_scenario(name) for name in names[first : first + _BATCH])
            forms = [form for form in in_scenarios if form is not None]
            if hazardous := (yield from self._drive(forms)):
                return hazardous[0]
        return self.smallest

    def _in_scenario(self, name: str) -> FaultForm | None:
        start_s = self.space.start_in(name)
        if start_s is None:
            return None
        is_at_time = self.smallest.start_s is not None
        return replace(self.smallest, scenario=name, start_s=start_s if is_at_time else None)

    def _single_injection(self) -> _Choice:
        count = self.space.injection_count
        if count < 2:
            return self.smallest
        alone = [replace(self.smallest, injection=number) for number in range(count)]
        hazardous = yield from self._drive(alone)
        return hazardous[0] if hazardous else self.smallest

    def _rounder_start(self) -> _Choice:
        """Choose the start with the fewest digits. No start is called minimal: hazards form islands in it."""
        start_s = self.smallest.start_s
        if start_s is None:
            self.notes.append("the start is that of the trigger")
            return self.smallest
        rounded = dict.fromkeys(float(f"{start_s:.{digits}g}") for digits in _START_DIGITS)
        starts = [start for start in rounded if start != start_s and 0.0 < start < self.space.end_s]
        hazardous = yield from self._drive(replace(self.smallest, start_s=start) for start in starts)
        return hazardous[0] if hazardous else self.smallest

    def _shortened_by_causality(self) -> _Choice:
        form, hazard_s = self.smallest, self.hazard_s(self.smallest)
        if form.duration_s is None or form.start_s is None or hazard_s is None:
            return form
        needed_s = hazard_s - form.start_s + _STEPS_AFTER_HAZARD * self.space.step_s
        duration_s = self.space.durations.at_least(round(needed_s, 9))
        if duration_s >= form.duration_s:
            return form
        hazardous = yield from self._drive([replace(form, duration_s=duration_s)])
        return hazardous[0] if hazardous else form

    def _smaller(self, axis: Axis) -> _Choice:
        """Make the form smaller on an axis, where 0 is no fault: try numbers of one digit, then of two."""
        numbers, low, form = self._numbers(axis), 0.0, self.smallest
        for digits in (1, 2):
            high = form.number(axis)
            if numbers is None or high is None:
                return form
            points = [low, *numbers.between(low, high, digits), high]
            bottom, top = yield from self._bisect(form, axis, points)
            low, form = points[bottom], form.with_number(axis, points[top])
        return form

    def _bisect(
        self, form: FaultForm, axis: Axis, points: Sequence[float]
    ) -> Generator[list[FaultForm], _Results, tuple[int, int]]:
        """Return neighbours among the points, without and with the hazard. The first point is without it, the
        last one is with it.
        """
        bottom, top = 0, len(points) - 1
        while top - bottom > 1:
            third = (top - bottom) / (_BATCH + 1)
            probes = sorted({bottom + max(1, round(third * part)) for part in range(1, _BATCH + 1)})
            forms = [form.with_number(axis, points[probe]) for probe in probes]
            hazardous = yield from self._drive(forms)
            top = min((probe for probe, f in zip(probes, forms, strict=True) if f in hazardous), default=top)
            bottom = max((probe for probe in probes if probe < top), default=bottom)
        return bottom, top

    def _without_smaller_neighbour(self) -> _Choice:
        """Go down as long as the next smaller form on an axis has the hazard."""
        form = self.smallest
        while True:
            neighbours = {axis: self.neighbour(form, axis) for axis in Axis}
            hazardous = yield from self._drive(smaller for smaller in neighbours.values() if smaller)
            if not hazardous:
                return form
            axis = next(axis for axis, smaller in neighbours.items() if smaller == hazardous[0])
            form = yield from self._descend(hazardous[0], axis)

    def _descend(self, form: FaultForm, axis: Axis) -> _Choice:
        """Go down from a form with the hazard by strides that double, until one has none."""
        count = 1
        while (smaller := self.neighbour(form, axis, count)) is not None:
            if not (yield from self._drive([smaller])):
                break
            form, count = smaller, count * 2
        return form

    def _numbers(self, axis: Axis) -> RoundNumbers | None:
        if axis is Axis.DURATION:
            return self.space.durations
        return self.space.sizes.numbers if self.space.sizes else None
