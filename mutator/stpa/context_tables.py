"""Context tables of the hazard analysis, from which guided triggers are taken."""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import Field

from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config.phrases_yaml import build_phrase
from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.model import Hold, Trigger
from mutator.stpa.context_coverage_proof import TableCoverage, measure_coverage
from mutator.targets.stored_phrases import PhraseByCase
from mutator.triggers.conditions import TIME, canonical_condition, names_in

CONTEXT_TABLE_SCHEMA = "context_table/1"
_CONSTANT_NAME_PATTERN = re.compile(r"[a-z][a-z0-9_]*\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionHazards:
    """The hazards that follow from one control action in one context; `null` means no hazard."""

    __pydantic_config__ = pydantic_mapping_config("The hazards of an action")

    provided: str | None = field(metadata=yaml_metadata("The hazard that occurs if the action is provided."))
    not_provided: str | None = field(
        metadata=yaml_metadata("The hazard that occurs if the action is not provided.")
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ContextRow:
    """A context: its id (`C1`), its condition with constants inserted, and the verdict on each control
    action.
    """

    id: str
    condition: str
    about: str
    phrase: PhraseByCase
    hazards_by_action: Mapping[str, ActionHazards]


@dataclass(frozen=True, kw_only=True)
class ContextTable:
    """A context table of the hazard analysis. Its rows cover every situation exactly once; `coverage` has the
    proof.
    """

    name: str
    about: str
    path: Path
    constants: Mapping[str, float]
    rows: tuple[ContextRow, ...]
    coverage: TableCoverage
    source: YamlSource

    def check_variables(self, variables: Collection[str]) -> None:
        """Raise MutatorError, with the line, for a row that uses an unknown variable."""
        _check_variable_names(self.rows, variables, self.source)

    def triggers(
        self,
        *,
        hold_s: float | None = None,
        armed_after_s: float = 0.0,
        rows: tuple[str, ...] | None = None,
    ) -> tuple[Trigger, ...]:
        """One trigger per row, or per row in `rows`, with the row's name; MutatorError for an unknown row.

        A trigger is active while the row's condition holds, or for `hold_s`.
        """
        by_id = {row.id: row for row in self.rows}
        unknown = [name for name in rows or () if name not in by_id]
        if unknown:
            raise MutatorError(
                f"context '{unknown[0]}'", where=self.path, expected=f"one of {', '.join(by_id)}"
            )
        return tuple(
            Trigger(
                name=name,
                condition=by_id[name].condition,
                hold=Hold.WHILE if hold_s is None else Hold.FOR,
                hold_s=hold_s,
                armed_after_s=armed_after_s,
            )
            for name in (by_id if rows is None else rows)
        )


class _ContextModel(StrictModel, title="A context"):
    when: str = Field(
        description="A condition. It may use `t` (s), the values observed in the target, and the constants."
    )
    about: str = Field(description="A description.")
    phrase: str | None = Field(
        None,
        description="The context as a clause, for the [sentence](../how-to/word-results.md) about an "
        "experiment: `while the car is close behind a slower vehicle`. Default: `while`, and the condition.",
    )
    actions: dict[str, YamlRecord[ActionHazards]] = Field(
        description="Control action -> its hazards. All contexts must have the same actions."
    )


class ContextTableModel(StrictModel, title="contexts/*.yaml"):
    """A context table. Its rows must cover every situation exactly once; see [what is
    proved](../explanation/hazard-analysis.md#what-is-proved-about-a-context-table).
    """

    name: str = Field(description="The name. It must match the file name without `.yaml`.")
    about: str = Field("", description="The subject of the table.")
    constants: dict[str, float] = Field(description="Name -> number, for use in the conditions.")
    contexts: dict[str, _ContextModel] = Field(description="Id -> context.")


def load_context_table(path: Path, variables: Collection[str] | None = None) -> ContextTable:
    """Read a context table. Conditions may use only `variables` (None: any names, to be checked later).

    MutatorError also if contexts provably overlap or leave a gap, or if rows judge different control actions.
    """
    model, source = load_yaml_model(path, ContextTableModel, CONTEXT_TABLE_SCHEMA)
    for name in model.constants:
        if not _CONSTANT_NAME_PATTERN.match(name) or name == TIME:
            raise source.error(
                ("constants", name),
                f"constant '{name}'",
                expected=f"a name other than '{TIME}' that begins with a letter and has only "
                "lowercase letters, digits and _",
            )
    rows = tuple(
        ContextRow(
            id=name,
            condition=_canonical_condition(row.when, model.constants, source, name),
            about=row.about,
            phrase=build_phrase(row.phrase, (), source, ("contexts", name, "phrase")),
            hazards_by_action=row.actions,
        )
        for name, row in model.contexts.items()
    )
    if variables is not None:
        _check_variable_names(rows, variables, source)
    _check_actions(rows, source)
    return ContextTable(
        name=model.name,
        about=model.about,
        path=path,
        constants=dict(model.constants),
        rows=rows,
        coverage=_checked_complete_coverage(rows, source),
        source=source,
    )


def _check_variable_names(rows: Iterable[ContextRow], variables: Collection[str], source: YamlSource) -> None:
    for row in rows:
        unknown = [name for name in names_in(row.condition) if name not in variables]
        if unknown:
            raise source.error(
                ("contexts", row.id, "when"),
                f"unknown name '{unknown[0]}' in '{row.condition}'",
                expected=f"one of the values observed in the target: {', '.join(variables)}",
                remedy="correct the name, or add it to `observation` in the target's manifest",
            )


def _check_actions(rows: tuple[ContextRow, ...], source: YamlSource) -> None:
    for row in rows[1:]:
        if row.hazards_by_action.keys() != rows[0].hazards_by_action.keys():
            raise source.error(
                ("contexts", row.id, "actions"),
                f"actions {', '.join(row.hazards_by_action) or '(none)'} in context '{row.id}'",
                expected=f"the actions of '{rows[0].id}': {', '.join(rows[0].hazards_by_action) or '(none)'}",
                remedy="judge every control action in every context",
            )


def _checked_complete_coverage(rows: tuple[ContextRow, ...], source: YamlSource) -> TableCoverage:
    coverage = measure_coverage({row.id: row.condition for row in rows})
    if coverage.first_gap_or_overlap is None:
        return coverage
    if not coverage.overlapping_rows:
        raise source.error(
            ("contexts",),
            f"no context holds at {coverage.first_gap_or_overlap}",
            expected="contexts that cover everything exactly once",
            remedy="add a context or widen one",
        )
    first, second = coverage.overlapping_rows[:2]
    raise source.error(
        ("contexts", second, "when"),
        f"context '{second}' overlaps '{first}' at {coverage.first_gap_or_overlap}",
        expected="contexts that cover everything exactly once",
        remedy="narrow one of the two",
    )


def _canonical_condition(text: str, constants: Mapping[str, float], source: YamlSource, row: str) -> str:
    with source.locating_errors(("contexts", row, "when")):
        return canonical_condition(text, constants)
