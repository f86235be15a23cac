"""Builds the experiments of a fault's simpler forms."""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property

from mutator._common.confined_files import path_below
from mutator.api.scenario_choice import digest_of_library_scenario
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.errors import MutatorError, MutatorWarning
from mutator.explore.fault_forms import FaultForm, SizeAxis
from mutator.explore.plane_building import explored_fault
from mutator.explore.round_numbers import RoundNumbers
from mutator.faults.draw_specs import DrawSpec
from mutator.faults.fault_specs import Variant
from mutator.faults.spec_expansion import draw_values
from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Fault, Injection, Method
from mutator.triggers.trigger_kinds import named_with_hold, trigger_at_time

_SMALLEST_SHARE = 0.001  # of the experiment's value: the smallest size that is tried


@dataclass(frozen=True)
class FormBuilder:
    """Builds the forms of one experiment; `is_explored` if it is one of an exploration."""

    selected_target: SelectedTarget
    original: Experiment
    is_explored: bool = False

    @cached_property
    def sizes(self) -> SizeAxis | None:
        """The fault's sizes; None for a fault without a value.

        The values that a spec lists are the simpler the earlier it lists them, unless they are distances from
        a value that changes nothing. Of other values, smaller ones are simpler if the fault changes nothing
        at 0; otherwise, only values with fewer digits are.
        """
        variant, value = self._variant, self.original.fault.value
        if variant is None or variant.draw is None or not isinstance(value, int | float):
            return None
        by_place = RoundNumbers(least=1.0, step=1.0)
        is_distance = not variant.paired_draws and self._changes_nothing_at_0()
        if variant.draw.kind == "list":
            values = _listed_up_to(self._listed_with_signs_of(variant, value), value, is_distance)
            return SizeAxis(largest=value, numbers=by_place, values=values)
        if not is_distance or value == 0:
            return SizeAxis(largest=value, numbers=by_place, values=_rounded(variant.draw, value))
        if variant.draw.kind == "integers" or variant.draw.decimals == 0:
            return SizeAxis(largest=value, numbers=by_place)
        return SizeAxis(largest=value, numbers=RoundNumbers(least=abs(value) * _SMALLEST_SHARE))

    @cached_property
    def note(self) -> str:
        """Why values are not tried; empty if they are, or if the fault has none."""
        fault = self.original.fault
        if fault.value is None or fault.module == OPERATOR_FAULTS_MODULE or self._variant is not None:
            return ""
        return "no other value was tried: the library has no spec of this fault"

    def build(self, form: FaultForm) -> Experiment:
        """Return the experiment of a form."""
        experiment = replace(self.original, fault=self._fault(form), end_s=None)
        if form.start_s is not None:
            trigger = named_with_hold(trigger_at_time(form.start_s, hold_s=form.duration_s))
            experiment = replace(experiment, trigger=trigger, method=Method.GUIDED)
        if form.scenario == self.original.scenario:
            return experiment
        digest = digest_of_library_scenario(self.selected_target.workspace, form.scenario)
        return replace(experiment, scenario=form.scenario, scenario_digest=digest, concrete=None)

    def check_spec_unchanged(self) -> None:
        """Raise MutatorError if the library's spec gives another fault than the experiment's."""
        fault = self.original.fault
        if self._variant is None:
            return
        value = fault.value if isinstance(fault.value, int | float) else None
        now = self._fault_with(value)
        expected = (now, explored_fault(now, self.selected_target.manifest))
        if self._without_seeds(fault) not in map(self._without_seeds, expected):
            raise MutatorError(
                f"the spec of {fault.label} changed since the run",
                where=self.selected_target.workspace.spec(_spec_name(fault)).path,
                expected="the fault that ran",
                remedy="undo the change, or run the campaign again and shrink the new experiment",
            )

    def _without_seeds(self, fault: Fault) -> Fault:
        """Return the fault without its seeds: a bench can give it others than its experiment's."""
        models = self.selected_target.models
        injections = tuple(
            replace(
                injection,
                params=tuple(
                    (name, value)
                    for name, value in injection.params
                    if (schema := models.get(injection.model).param(name)) is None or schema.type != "seed"
                ),
            )
            for injection in fault.injections
        )
        return replace(fault, injections=injections)

    @cached_property
    def _variant(self) -> Variant | None:
        """The library's variant of the fault; None if it has none."""
        fault = self.original.fault
        if fault.module == OPERATOR_FAULTS_MODULE:
            return None
        workspace = self.selected_target.workspace
        if (
            path_below(workspace.library / "faults", f"{_spec_name(fault)}.yaml")
            not in workspace.spec_files()
        ):
            return None
        spec = workspace.spec(_spec_name(fault))
        return next((variant for variant in spec if f"{spec.name}/{variant.name}" == fault.spec), None)

    def _fault(self, form: FaultForm) -> Fault:
        fault, sizes = self.original.fault, self.sizes
        if sizes is not None and form.size is not None and form.size != sizes.largest_size:
            fault = replace(self._fault_with(sizes.value(form.size)), hold=fault.hold, changes=fault.changes)
        if form.injection is None:
            return fault
        return replace(fault, injections=(fault.injections[form.injection],))

    def _fault_with(self, value: float | None) -> Fault:
        fault = self.original.fault
        built = self.selected_target.fault(
            fault.spec, value=value, seed=self.original.seed, reading=fault.reading or None, beyond=True
        )
        return explored_fault(built, self.selected_target.manifest) if self.is_explored else built

    def _listed_with_signs_of(self, variant: Variant, value: float) -> tuple[float, ...]:
        """Return the values that a spec lists, without those that have another sign than `value`, or whose
        paired values have another one than its.
        """
        seed = self.original.seed
        listed = list(zip(*(draw_values(draw, seed) for draw in variant.all_draws), strict=True))
        reference = next((values for values in listed if values[0] == value), (value,))
        return tuple(
            values[0] for values in listed if all(a * b >= 0 for a, b in zip(values, reference, strict=False))
        )

    def _changes_nothing_at_0(self) -> bool:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MutatorWarning)  # that it changes nothing
                injections = self._fault_with(0.0).injections
        except MutatorError:  # 0 is out of range
            return False
        return all(map(self._is_neutral_within_bounds, injections))

    def _is_neutral_within_bounds(self, injection: Injection) -> bool:
        params = dict(injection.params)
        model = self.selected_target.models.get(injection.model)
        return any(p.neutral is not None and params.get(p.name) == p.neutral for p in model.params)


def _spec_name(fault: Fault) -> str:
    return f"{fault.module}/{fault.fault_type}"


def _listed_up_to(values: tuple[float, ...], value: float, is_distance: bool) -> tuple[float, ...]:
    if is_distance:
        values = tuple(sorted((other for other in values if other * value > 0), key=abs))
    if value not in values:  # a bench takes any value
        return (*(other for other in values if is_distance and abs(other) < abs(value)), value)
    return values[: values.index(value) + 1]


def _rounded(draw: DrawSpec, value: float) -> tuple[float, ...]:
    """Return the value rounded to one digit and to two, in the draw's range, and the value."""
    low, high = draw.least_and_greatest
    rounded = (float(f"{value:.{digits}g}") for digits in (1, 2))
    return tuple(dict.fromkeys((*(number for number in rounded if low <= number <= high), value)))
