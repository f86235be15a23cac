"""Find the workspace, target, faults and triggers that a user names."""

import dataclasses
import re
import warnings
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TypeAlias

from mutator._common.argument_checks import check_number, check_whole_number
from mutator._common.message_text import spelling_suggestion
from mutator._common.phrase_texts import planned_number_text
from mutator.campaigns.neutral_faults import is_neutral_fault
from mutator.checks.library_check import spec_problems
from mutator.config import units
from mutator.errors import MutatorError, MutatorWarning
from mutator.faults.fault_models import FaultModels
from mutator.faults.fault_specs import FaultSpec, Variant
from mutator.faults.spec_expansion import draw_values, expand_spec
from mutator.model import Fault, Trigger
from mutator.stpa.context_tables import ContextTable
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import TRIGGER_FORMS, parse_trigger
from mutator.workspace import Workspace

WorkspaceLike: TypeAlias = "Workspace | str | PathLike[str] | None"
FaultLike: TypeAlias = "Fault | str | PathLike[str]"
TriggerLike: TypeAlias = "Trigger | str | float"

_CONTEXT_NAME_PATTERN = re.compile(r"(?!nan$|inf)(?:[A-Za-z_]\w*/)?[A-Za-z_]\w*")  # but not a number


def open_workspace(workspace: WorkspaceLike) -> Workspace:
    if isinstance(workspace, Workspace):
        return workspace
    return Workspace.find(None if workspace is None else Path(workspace))


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultChoice:
    """A choice of faults of one spec, named or in a file. `value` replaces the drawn values."""

    spec: str
    variant: str | None = None
    value: float | None = None
    seed: int | None = None
    reading: str | None = None
    beyond: bool | None = None  # whether `value` may be outside the declared range; None: with a warning

    def narrow(self, spec: FaultSpec) -> FaultSpec:
        variants = tuple(v for v in spec if self.variant in (None, v.name))
        if not variants:
            names = ", ".join(v.name for v in spec)
            raise MutatorError(f"no variant {self.variant!r}", where=spec.path, expected=f"one of {names}")
        if self.value is not None:
            check_number("value", self.value)
            variants = tuple(_with_value(spec, v, self.value, self.seed or 0) for v in variants)
        return dataclasses.replace(spec, variants=variants)


@dataclass(frozen=True)
class SelectedTarget:
    """A workspace with one of its targets."""

    workspace: Workspace
    manifest: TargetManifest

    @classmethod
    def of(cls, workspace: WorkspaceLike, target: str | None = None) -> "SelectedTarget":
        opened_workspace = open_workspace(workspace)
        return cls(opened_workspace, opened_workspace.manifest(opened_workspace.target_name(target)))

    @cached_property
    def models(self) -> FaultModels:
        return self.workspace.fault_models()

    def faults(self, choice: FaultChoice) -> tuple[Fault, ...]:
        """Return the chosen faults, at least one, in the spec's order.

        MutatorError for a mistake in the spec; MutatorWarning for a value that changes nothing or is outside
        the declared range.
        """
        check_whole_number("seed", 0 if choice.seed is None else choice.seed)
        declared = self.workspace.spec(choice.spec)
        spec = choice.narrow(declared)
        for problem in spec_problems(spec, self.models, self.manifest):
            raise problem
        faults = expand_spec(
            spec, choice.seed or 0, choice.reading, models=self.models, manifest=self.manifest
        )
        if choice.value is not None:
            _warn_of_ineffective(faults, self.models)
            _check_range(choice, choice.value, declared, faults)
        return faults

    def fault(
        self,
        fault_like: FaultLike,
        *,
        value: float | None = None,
        seed: int = 0,
        reading: str | None = None,
        beyond: bool | None = None,
    ) -> Fault:
        """Return the given fault, or the middle one of the first matching variant.

        `beyond`: whether `value` may be outside the declared range; None: with a warning.
        """
        if isinstance(fault_like, Fault):
            if value is not None or reading is not None:
                raise MutatorError(
                    f"{fault_like.label} together with a value or a reading",
                    argument="fault",
                    expected="a fault alone, or the name of a spec with a value or a reading",
                )
            return fault_like
        spec, variant = _split_variant(str(fault_like))
        # the ranges of other variants do not matter
        variant = variant or next(iter(self.workspace.spec(spec))).name
        choice = FaultChoice(
            spec=spec, variant=variant, value=value, seed=seed, reading=reading, beyond=beyond
        )
        return middle_of_each_variant(self.faults(choice))[0][0]

    def trigger(self, trigger_like: TriggerLike, armed_after_s: float | None = None) -> Trigger:
        """Return the given trigger, or one from a context (`C1`), a time in s, `always` or a condition.

        Contexts, `always` and conditions are armed after `armed_after_s`; default: the manifest's.
        """
        if armed_after_s is not None:
            check_number("armed_after_s", armed_after_s, least=0)
        if isinstance(trigger_like, Trigger):
            return trigger_like
        if not isinstance(trigger_like, str):
            check_number("trigger", trigger_like, least=0)
        arming_time_s = self.manifest.armed_after_s if armed_after_s is None else armed_after_s
        return context_or_parsed_trigger(
            self.workspace, str(trigger_like), arming_time_s, self.manifest.observation.variables
        )


def middle_of_each_variant(faults: Iterable[Fault]) -> tuple[tuple[Fault, int], ...]:
    """Return the middle fault of each variant, and the variant's number of faults."""
    groups: dict[str, list[Fault]] = {}
    for fault in faults:
        groups.setdefault(fault.spec, []).append(fault)
    return tuple((group[len(group) // 2], len(group)) for group in groups.values())


def context_tables(workspace: Workspace) -> tuple[ContextTable, ...]:
    return tuple(map(workspace.context_table, workspace.context_tables))


def context_or_parsed_trigger(
    workspace: Workspace, trigger_text: str, armed_after_s: float, variables: Collection[str]
) -> Trigger:
    tables = context_tables(workspace)
    matches = [
        (table, row.id)
        for table in tables
        for row in table.rows
        if trigger_text in (row.id, f"{table.name}/{row.id}")
    ]
    if len(matches) > 1:  # tables can use the same id for a row
        qualified_names = ", ".join(f"{table.name}/{row}" for table, row in matches)
        raise MutatorError(
            f"context '{trigger_text}' is in {len(matches)} tables",
            argument="trigger",
            expected=f"one of {qualified_names}",
        )
    if matches:
        table, row = matches[0]
        table.check_variables(variables)
        return table.triggers(armed_after_s=armed_after_s, rows=(row,))[0]
    try:
        return parse_trigger(trigger_text, armed_after_s, variables)
    except MutatorError as e:
        context_names = [row.id for table in tables for row in table.rows]
        contexts = f"a context ({', '.join(context_names)}), " if context_names else ""
        got, remedy = e.got, e.remedy
        if _CONTEXT_NAME_PATTERN.fullmatch(trigger_text) and trigger_text not in variables:
            got = f"no context '{trigger_text}'"
            remedy = "correct the name" + spelling_suggestion(trigger_text, [*context_names, *variables])
        raise MutatorError(
            got, argument="trigger", expected=f"{contexts}{TRIGGER_FORMS}", remedy=remedy
        ) from e


def _split_variant(name: str) -> tuple[str, str | None]:
    """Split `sensor/bias/distance` into the spec `sensor/bias` and its variant; a file is a spec."""
    parts = name.split("/")
    if len(parts) == 3 and not name.endswith((".yaml", ".yml")):
        return "/".join(parts[:2]), parts[2]
    return name, None


def _warn_of_ineffective(faults: Collection[Fault], models: FaultModels) -> None:
    ineffective = [fault.label for fault in faults if is_neutral_fault(fault, models)]
    if ineffective:
        warnings.warn(f"the value changes nothing: {', '.join(ineffective)}", MutatorWarning, stacklevel=4)


def _check_range(
    choice: FaultChoice, value: float, declared_spec: FaultSpec, faults: Collection[Fault]
) -> None:
    """Refuse a value outside the range that the spec declares, or warn of it, as `choice.beyond` says."""
    outside = []
    for variant in declared_spec:
        if variant.draw and f"{declared_spec.name}/{variant.name}" in {fault.spec for fault in faults}:
            low, high = variant.draw.least_and_greatest
            unit = f" {units.UNITS[variant.draw.unit].symbol}" if variant.draw.unit else ""
            if not low <= value <= high:
                outside.append(f"{declared_spec.name}/{variant.name}, {low:g} to {high:g}{unit}")
    if not outside or choice.beyond:
        return
    exact_value = planned_number_text(value if isinstance(value, int) else float(value))
    text = f"value {exact_value} is outside the range that the spec declares: {'; '.join(outside)}"
    if choice.beyond is None:
        warnings.warn(text, MutatorWarning, stacklevel=4)
        return
    raise MutatorError(
        text,
        where=declared_spec.path,
        argument="value",
        remedy="choose a value in the range, or allow others with `beyond`",
    )


def _with_value(spec: FaultSpec, variant: Variant, value: float, seed: int) -> Variant:
    """Return a variant with only this value. One that a campaign draws keeps its number."""
    if variant.draw is None:
        raise MutatorError(
            f"variant {variant.name!r} takes no value",
            where=spec.path,
            argument="value",
            remedy="leave `value` out",
        )
    # as YAML would give it: 40, not 40.0, in the id and in the injected line
    exact_value = int(value) if float(value).is_integer() else float(value)
    if variant.paired_draws:
        return _with_listed_value(spec, variant, exact_value)
    drawn_values, number = draw_values(variant.draw, seed), 0
    if exact_value in drawn_values:
        number = drawn_values.index(exact_value)
        exact_value = drawn_values[number]  # 21.0 in the id, if so drawn
    draw = dataclasses.replace(variant.draw, kind="list", ranges=(), values=(exact_value,))
    return dataclasses.replace(variant, draw=draw, first_value_number=number)


def _with_listed_value(spec: FaultSpec, variant: Variant, value: float) -> Variant:
    """Keep the pair whose first value is `value`."""
    first = variant.all_draws[0]
    if value not in first.values:
        raise MutatorError(
            f"value {value:g}",
            where=spec.path,
            argument="value",
            expected=f"one of {', '.join(map(str, first.values))}, because the values come in pairs",
        )
    number = first.values.index(value)
    draw, *paired = (dataclasses.replace(each, values=(each.values[number],)) for each in variant.all_draws)
    return dataclasses.replace(variant, draw=draw, paired_draws=tuple(paired), first_value_number=number)
