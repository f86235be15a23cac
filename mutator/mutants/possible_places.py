"""Lists every place in a file where a fault can be injected, with the fault models that fit."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mutator.config.location_syntax import is_assignable, is_dotted_name, location_as_yaml
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, FaultModels, SnippetKind, TemplateNeed
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.changeable_expressions import NO_TEMPLATE_PARTS, Expression, template_parts
from mutator.mutants.hidden_builtins import builtins_always_called, hidden_builtins_at
from mutator.mutants.parsed_files_and_anchors import (
    ParsedFile,
    ResolvedAnchor,
    functions_named,
    normalized_function_name,
)
from mutator.mutants.statement_template_texts import anchor_and_one_line_texts

_OPERATOR_MODEL_PREFIX = "operator_"  # models of mutation operators, which find their own places
# nothing after a `return` runs, so it has no anchor behind it
_ANCHOR_KINDS_BY_VERB = {
    "assign": (AnchorKind.BEFORE_ASSIGN, AnchorKind.AFTER_ASSIGN),
    "call": (AnchorKind.BEFORE_CALL, AnchorKind.AFTER_CALL),
    "return": (AnchorKind.BEFORE_RETURN,),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ListedPlace:
    """A place where a fault can be injected, with the names of the fault models that fit."""

    line: int  # from 1
    location: FaultLocation
    models: tuple[str, ...]

    @property
    def at(self) -> dict[str, Any]:
        return location_as_yaml(self.location)


def places_of(file: ParsedFile, models: FaultModels, function: str | None = None) -> list[ListedPlace]:
    """Return all places of a file or function, in order.

    A statement is listed under each name that it assigns or calls, an expression under its most specific
    anchor. MutatorError with the file's functions if `function` is not one of them.
    """
    lister = _PlaceLister(
        file, [model for model in models if not model.name.startswith(_OPERATOR_MODEL_PREFIX)]
    )
    names = tuple(file.functions_by_name)
    if function is not None:
        functions_named(file, function)  # raises if there is none
        names = (normalized_function_name(function),)
    places = [place for name in names for place in lister.places_in_function(name)]
    places += lister.constant_and_default_places(None if function is None else names[0])
    return sorted(places, key=lambda place: place.line)


class _PlaceLister:
    def __init__(self, file: ParsedFile, models: Sequence[FaultModel]) -> None:
        self.file = file
        self.models = models

    def places_in_function(self, name: str) -> Iterator[ListedPlace]:
        functions = self.file.functions_by_name[name]
        for i, function in enumerate(functions):
            if function.entry_and_indent_lines is not None:
                yield from self.statement_places(
                    name, AnchorKind.ENTRY, "", i + 1 if len(functions) > 1 else None
                )
        for verb, kinds in _ANCHOR_KINDS_BY_VERB.items():
            anchorable = (s for f in functions for s in f.statements if not s.unanchorable_reason)
            statements = sorted(
                anchorable, key=lambda s: s.block_start_of_head_binding is not None
            )  # in the order of `nth`
            totals, numbers = (Counter[str]() for _ in range(2))
            totals.update(n for s in statements for n in s.names_for(verb))
            for statement in statements:
                names = statement.names_for(verb)
                numbers.update(names)
                usable_names = [bound_name for bound_name in names if is_writable_in_spec(bound_name)]
                for bound_name in usable_names[-1:] if verb == "return" else usable_names:
                    for kind in kinds:
                        yield from self.statement_places(
                            name, kind, bound_name, numbers[bound_name] if totals[bound_name] > 1 else None
                        )
        yield from self.expression_places(name)

    def statement_places(
        self, function: str, kind: AnchorKind, name: str, nth: int | None
    ) -> Iterator[ListedPlace]:
        location = self.location_at(function, Anchor(kind=kind, name=name, nth=nth))
        try:
            anchor = self.file.resolve_statement(location)
        except MutatorError:
            return  # for example, because the statement shares its line
        models = tuple(
            model.name
            for model in self.models
            if self.fits_statement(model, kind, anchor)
            and not self.meets_hidden_builtin(model.template, anchor.first_line)
        )
        if models:
            yield ListedPlace(
                line=min(anchor.first_line, len(self.file.lines) - 1) + 1, location=location, models=models
            )

    def fits_statement(self, model: FaultModel, kind: AnchorKind, anchor: ResolvedAnchor) -> bool:
        if model.needs is TemplateNeed.CALL or (
            model.kind is SnippetKind.VALUE and kind is not AnchorKind.AFTER_ASSIGN
        ):
            return False
        if model.kind is SnippetKind.VALUE and model.expression_parts:
            return False
        if model.kind is SnippetKind.GUARD and (
            anchor.first_line == anchor.end_line or not anchor.is_alone_on_line or anchor.inserts_after
        ):
            return False
        if model.needs is not None:
            try:
                anchor_and_one_line_texts(self.file, anchor, model.needs)
            except MutatorError:
                return False
        return True

    def expression_places(self, function: str) -> Iterator[ListedPlace]:
        expressions = self.file.expressions_by_function.get(function, ())
        totals = Counter(role for expression in expressions for role in dict.fromkeys(expression.roles))
        numbers = Counter[Any]()
        for expression in expressions:
            kind, name, which = role = expression.roles[0]
            numbers.update(dict.fromkeys(expression.roles, 1))
            nth = numbers[role] if totals[role] > 1 else None
            location = self.location_at(function, Anchor(kind=kind, name=name, which=which, nth=nth))
            models = self.models_of_value(expression, expression.start[0])
            yield ListedPlace(line=expression.start[0] + 1, location=location, models=models)

    def constant_and_default_places(self, function: str | None) -> Iterator[ListedPlace]:
        for value in self.file.constants_and_defaults:
            if value.unsettable_reason is None and function in (None, value.function):
                location = self.location_at(value.function, Anchor(kind=value.kind, name=value.name))
                models = self.models_of_value(None, value.first_line)
                yield ListedPlace(line=value.first_line + 1, location=location, models=models)

    def models_of_value(self, expression: Expression | None, line: int) -> tuple[str, ...]:
        return tuple(
            model.name
            for model in self.models
            if can_change_value(model, expression)
            and not self.meets_hidden_builtin(model.expression_template or "", line)
        )

    def meets_hidden_builtin(self, template: str, line: int) -> bool:
        """Whether the template calls a built-in function that the file hides at a line (from 0)."""
        return not builtins_always_called(template).isdisjoint(hidden_builtins_at(self.file, line))

    def location_at(self, function: str, anchor: Anchor) -> FaultLocation:
        return FaultLocation(path=self.file.path, function=function, anchor=anchor)


def is_writable_in_spec(name: str) -> bool:
    """Return whether a spec can use this name of a statement. `None`, as in `return None`, is not a name."""
    return not name or is_dotted_name(name) or is_assignable(name)


def can_change_value(model: FaultModel, expression: Expression | None) -> bool:
    """Return whether a model can change this expression or, for None, a constant or default."""
    if model.expression_template is None:
        return False
    parts = template_parts(expression) if expression else NO_TEMPLATE_PARTS
    needed = {"called"} if model.needs is TemplateNeed.CALL else set()
    return all(parts[name] is not None and parts[name] != [] for name in needed | model.expression_parts)
