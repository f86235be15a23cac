"""Whether the faults of a plan are those that their names say.

A plan is compared with itself, which needs no library: all faults of a variant inject the same code at the
same places, and the challengers follow from its constant errors.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from mutator.errors import MutatorError
from mutator.explore.challengers import FORM_MARK, SIZE_PARAM, challenging_fault, is_challenger
from mutator.model import Experiment, Fault, Injection, Value

_RELATIVE_TOLERANCE = 1e-9  # units are converted with rounding
_Variant = tuple[str, int]  # its name, with that of a seed of the fault, and the seed of the runs


@dataclass(slots=True)
class PlannedFaults:
    """The faults of a plan. Each is noted before any is checked. `step_s` is the target's."""

    step_s: float
    _constant: dict[_Variant, dict[Value, tuple[int, Fault]]] = field(default_factory=dict)
    _challenging: list[tuple[int, Experiment]] = field(default_factory=list)
    _contradicting: list[int] = field(default_factory=list)

    def note(self, position: int, experiment: Experiment) -> None:
        """Note the experiment at this position of the plan."""
        fault = experiment.fault
        if is_challenger(fault.spec.partition(FORM_MARK)[2]):
            self._challenging.append((position, experiment))
            return
        faults = self._constant.setdefault((fault.spec, experiment.seed), {})
        if faults.setdefault(fault.value, (position, fault))[1] != fault:
            self._contradicting.append(position)

    def wrong_positions(self) -> Iterator[int]:
        """Yield the positions of experiments that inject something else than their names and values say."""
        yield from self._contradicting
        challenged = {_challenged_variant(experiment) for _, experiment in self._challenging}
        for variant, faults in self._constant.items():
            for position, fault in faults.values():
                # sizes of other faults need not be in proportion to their values
                expected = self._scaled(variant, fault.value) if variant in challenged else fault
                first = next(iter(faults.values()))[1]
                if _without_sizes(fault) != _without_sizes(first) or not _is_close(fault, expected):
                    yield position
        for position, experiment in self._challenging:
            if not self._is_expected_challenger(experiment):
                yield position

    def _is_expected_challenger(self, experiment: Experiment) -> bool:
        variant, fault = _challenged_variant(experiment), experiment.fault
        if variant not in self._constant:
            return False
        driven = self._constant[variant].get(fault.value)
        try:
            expected = challenging_fault(
                driven[1] if driven else self._scaled(variant, fault.value),
                fault.spec.partition(FORM_MARK)[2],
                duration_s=experiment.trigger.hold_s or 0.0,
                step_s=self.step_s,
                seed=experiment.seed,
            )
        except MutatorError:  # no such challenger, or none of such a fault
            return False
        return fault == expected if driven else _is_close(fault, expected)

    def _scaled(self, variant: _Variant, value: Value) -> Fault:
        """Return a variant's constant error of another size. The size, and parameters that differ among its
        faults, are in proportion to the value, because that is what a spec gives them, in some unit.
        """
        faults = [fault for _, fault in self._constant[variant].values()]
        first, last = faults[0], faults[-1]
        factor = _ratio(value, first.value)
        injections = (
            _scaled_injection(injection, dict(other.params), factor)
            for injection, other in zip(first.injections, last.injections, strict=False)
        )
        return replace(first, value=value, injections=tuple(injections))


def _challenged_variant(experiment: Experiment) -> _Variant:
    return experiment.fault.spec.partition(FORM_MARK)[0], experiment.seed


def _ratio(value: Value, other: Value) -> float:
    """Return the ratio of two sizes; NaN, which is like no other number, if there is none."""
    if not isinstance(value, int | float) or not isinstance(other, int | float) or not other:
        return math.nan
    return value / other


def _scaled_injection(injection: Injection, others: dict[str, Value], factor: float) -> Injection:
    """Scale the size of the error, and what differs from the parameters of another fault."""
    return replace(
        injection,
        params=tuple(
            (name, param * factor if isinstance(param, int | float) and is_scaled else param)
            for name, param in injection.params
            for is_scaled in [name == SIZE_PARAM or others.get(name) != param]
        ),
    )


def _without_sizes(fault: Fault) -> Fault:
    """Return the fault with the names of its parameters alone."""
    injections = (
        replace(injection, params=tuple((name, None) for name, _ in injection.params))
        for injection in fault.injections
    )
    return replace(fault, value=None, injections=tuple(injections))


def _is_close(fault: Fault, expected: Fault) -> bool:
    """Whether two faults are the same but for rounding."""
    return (
        fault.value == expected.value
        and _without_sizes(fault) == _without_sizes(expected)
        and all(
            _is_close_param(param, other)
            for injection, expected_injection in zip(fault.injections, expected.injections, strict=True)
            for (_, param), (_, other) in zip(injection.params, expected_injection.params, strict=True)
        )
    )


def _is_close_param(param: Value, other: Value) -> bool:
    if isinstance(param, float) and isinstance(other, int | float):
        return math.isclose(param, other, rel_tol=_RELATIVE_TOLERANCE)
    return param == other
