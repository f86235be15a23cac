"""Checks that the planned faults of an exploration are those that the library gives."""

import sys
import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, zip_longest

from mutator.api.explored_faults import fault_builder
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.audit.run_audit import AuditCheck
from mutator.errors import MutatorError, MutatorWarning
from mutator.explore.challengers import FORM_MARK
from mutator.model import Experiment, Fault
from mutator.store import plan_file
from mutator.store.plan_file import EXPERIMENTS_FILE
from mutator.store.run_folder import RunFolder

_REMEDY = (
    "either the library has changed since: verify with that of the run; or the plan was edited: restore the "
    "run folder from a copy"
)


def library_fault_check(
    folder: RunFolder, selected_target: SelectedTarget, facts: dict[str, str]
) -> AuditCheck:
    """Build the faults of an exploration's plan again, and compare what they inject. `facts` gets the specs
    that the library does not have: their faults are not compared.
    """
    comparison = _LibraryComparison(folder, selected_target)

    def problems() -> Iterator[MutatorError]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MutatorWarning)  # the exploration has shown them
            yield from comparison.problems()
        if comparison.missing_specs:
            facts["not in the library"] = ", ".join(sorted(comparison.missing_specs))

    return AuditCheck.from_problems(
        "planned faults that the library gives", folder.head.experiments, problems()
    )


class _LibraryComparison:
    """Compares the plan of an exploration with the library, and notes the specs that this does not have."""

    def __init__(self, folder: RunFolder, selected_target: SelectedTarget) -> None:
        self._path = folder.path
        self._build = fault_builder(selected_target, folder.head.reading)
        faults = selected_target.workspace.library / "faults"
        paths = selected_target.workspace.spec_files()
        self._specs = {path.relative_to(faults).with_suffix("").as_posix() for path in paths}
        self.missing_specs: set[str] = set()

    def problems(self) -> Iterator[MutatorError]:
        """Yield the first difference of each variant and form."""
        wrong: set[str] = set()
        for line, experiment in enumerate(plan_file.iterate_experiments(self._path), start=1):
            fault = experiment.fault
            spec = fault.spec.partition(FORM_MARK)[0].rpartition("/")[0]
            if spec not in self._specs:
                self.missing_specs.add(spec)
            elif fault.spec not in wrong and (difference := self._difference(experiment)):
                wrong.add(fault.spec)
                yield MutatorError(
                    f"the library's fault {fault.label} injects something else than the plan says: "
                    f"{difference}",
                    where=self._path / EXPERIMENTS_FILE,
                    line=line,
                    remedy=_REMEDY,
                )

    def _difference(self, experiment: Experiment) -> str:
        """Return how a planned fault and the library's differ, in words; empty if they are the same."""
        fault, value = experiment.fault, experiment.fault.value
        if value is not None and not (isinstance(value, int | float) and abs(value) <= sys.float_info.max):
            return f"{value} is no finite number"
        try:
            expected = self._build(fault.spec, value, experiment.seed, experiment.trigger.hold_s or 0.0)
        except MutatorError as error:
            return error.got
        if replace(expected, aim=fault.aim) == fault:  # the aim is no part of what is injected
            return ""
        return _param_difference(fault, expected) or "not the same place, model, changes or duration"


def _param_difference(fault: Fault, expected: Fault) -> str:
    params, expected_params = (
        chain.from_iterable(injection.params for injection in each.injections) for each in (fault, expected)
    )
    for param, other in zip_longest(params, expected_params):
        if param != other and param and other and param[0] == other[0]:
            return f"{other[0]} {other[1]} in the library, {param[1]} in the plan"
    return ""
