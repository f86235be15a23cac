"""The faults that explorations drive, as the library gives them."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.explore.challengers import FORM_MARK, challenging_fault, is_challenger, seed_number
from mutator.explore.plane_building import explored_fault
from mutator.model import Fault

# builds the fault of a variant, or of a form of it: its name, value, seed of the runs, duration in s
BuildFault = Callable[[str, float | None, int, float], Fault]


def fault_builder(selected_target: SelectedTarget, reading: str) -> BuildFault:
    """Return what builds the faults of an exploration. It raises MutatorError for those that do not exist."""

    @cache
    def constant_fault(spec: str, value: float | None, seed: int) -> Fault:
        fault = selected_target.fault(spec, value=value, seed=seed, reading=reading, beyond=True)
        return explored_fault(fault, selected_target.manifest)

    def build(name: str, value: float | None, seed: int, duration_s: float) -> Fault:
        spec, _, form = name.partition(FORM_MARK)
        if not is_challenger(form):
            return replace(constant_fault(spec, value, seed + seed_number(form)), spec=name)
        fault, step_s = constant_fault(spec, value, seed), selected_target.manifest.step_s
        return challenging_fault(fault, form, duration_s=duration_s, step_s=step_s, seed=seed)

    return build
