"""Lists every place in a file where a fault can be injected, with the fault models that fit."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mutator.config.location_syntax import as_written_at, assignable, dotted_name
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, FaultModels, Needs, SnippetKind
from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants.anchors import ParsedFile, Site, functions_named, plain_name
from mutator.mutants.expressions import NO_PARTS, Expression, parts_of
from mutator.mutants.statement_texts import written_out

_OF_OPERATORS = "operator_"  # models of mutation operators, which find their own places
_VERBS = {
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
        return as_written_at(self.location)


def places_of(file: ParsedFile, models: FaultModels, function: str | None = None) -> list[ListedPlace]:
    """Return all places of a file or function, in order.

    A statement is listed under each name that it assigns or calls, an expression under its most specific
    anchor. MutatorError with the file's functions if `function` is not one of them.
    """
    lister = _Lister(file, [model for model in models if not model.name.startswith(_OF_OPERATORS)])
    names = tuple(file.functions)
    if function is not None:
        functions_named(file, function)  # raises if there is none
        names = (plain_name(function),)
    places = [place for name in names for place in lister.of_function(name)]
    places += lister.fixed(None if function is None else names[0])
    return sorted(places, key=lambda place: place.line)


class _Lister:
    def __init__(self, file: ParsedFile, models: Sequence[FaultModel]) -> None:
        self.file = file
        self.models = models

    def of_function(self, name: str) -> Iterator[ListedPlace]:
        functions = self.file.functions[name]
        for i, function in enumerate(functions):
            if function.entry is not None:
                yield from self.statement(name, AnchorKind.ENTRY, "", i + 1 if len(functions) > 1 else None)
        for verb, kinds in _VERBS.items():
            anchorable = (s for f in functions for s in f.statements if not s.reason)
            statements = sorted(anchorable, key=lambda s: s.opens is not None)  # in the order of `nth`
            totals, numbers = (Counter[str]() for _ in range(2))
            totals.update(one for s in statements for one in s.names(verb))
            for statement in statements:
                names = statement.names(verb)
                numbers.update(names)
                usable_names = [one for one in names if writable(one)]
                for one in usable_names[-1:] if verb == "return" else usable_names:
                    for kind in kinds:
                        yield from self.statement(name, kind, one, numbers[one] if totals[one] > 1 else None)
        yield from self.values(name)

    def statement(self, function: str, kind: AnchorKind, name: str, nth: int | None) -> Iterator[ListedPlace]:
        location = self.location(function, Anchor(kind=kind, name=name, nth=nth))
        try:
            site = self.file.resolve(location)
        except MutatorError:
            return  # for example, because the statement shares its line
        models = tuple(model.name for model in self.models if self.fits(model, kind, site))
        if models:
            yield ListedPlace(
                line=min(site.first, len(self.file.lines) - 1) + 1, location=location, models=models
            )

    def fits(self, model: FaultModel, kind: AnchorKind, site: Site) -> bool:
        if model.needs is Needs.CALL or (
            model.kind is SnippetKind.VALUE and kind is not AnchorKind.AFTER_ASSIGN
        ):
            return False
        if model.kind is SnippetKind.VALUE and model.parts:
            return False
        if model.kind is SnippetKind.GUARD and (site.first == site.last or not site.alone or site.after):
            return False
        if model.needs is not None:
            try:
                written_out(self.file, site, model.needs)
            except MutatorError:
                return False
        return True

    def values(self, function: str) -> Iterator[ListedPlace]:
        expressions = self.file.expressions.get(function, ())
        totals = Counter(role for expression in expressions for role in dict.fromkeys(expression.roles))
        numbers = Counter[Any]()
        for one in expressions:
            kind, name, which = role = one.roles[0]
            numbers.update(dict.fromkeys(one.roles, 1))
            nth = numbers[role] if totals[role] > 1 else None
            location = self.location(function, Anchor(kind=kind, name=name, which=which, nth=nth))
            models = tuple(model.name for model in self.models if changes(model, one))
            yield ListedPlace(line=one.start[0] + 1, location=location, models=models)

    def fixed(self, function: str | None) -> Iterator[ListedPlace]:
        models = tuple(model.name for model in self.models if changes(model, None))
        for value in self.file.fixed:
            if value.reason is None and function in (None, value.function):
                location = self.location(value.function, Anchor(kind=value.kind, name=value.name))
                yield ListedPlace(line=value.first + 1, location=location, models=models)

    def location(self, function: str, anchor: Anchor) -> FaultLocation:
        return FaultLocation(path=self.file.path, function=function, anchor=anchor)


def writable(name: str) -> bool:
    """Return whether a spec can use this name of a statement. `None`, as in `return None`, is not a name."""
    return not name or dotted_name(name) or assignable(name)


def changes(model: FaultModel, expression: Expression | None) -> bool:
    """Return whether a model can change this expression or, for None, a constant or default."""
    if model.expression is None:
        return False
    parts = parts_of(expression) if expression else NO_PARTS
    needed = {"called"} if model.needs is Needs.CALL else set()
    return all(parts[name] is not None and parts[name] != [] for name in needed | model.parts)
