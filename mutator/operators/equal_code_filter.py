"""Drops mutations whose function compiles to the same code as the original or an earlier mutation."""

from collections.abc import Iterable
from dataclasses import dataclass

from mutator.engines.code_swap import essence
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.expressions import Expression
from mutator.mutants.standalone_functions import compiled_alone
from mutator.operators.mutations import Mutation


@dataclass(frozen=True, slots=True, kw_only=True)
class Distinct:
    """Mutations with distinct code, and the numbers of those left out."""

    mutations: tuple[Mutation, ...]
    equal: int  # same code as the original
    twins: int  # same code as an earlier mutation
    invalid: int  # does not compile


def distinct(file: ParsedFile, mutations: Iterable[Mutation]) -> Distinct:
    """Keep a file's mutations whose active code differs from the original and from earlier mutations."""
    known: dict[range, list[object]] = {}  # by function, the original's code first
    kept: list[Mutation] = []
    equal = twins = invalid = 0
    for mutation in mutations:
        function = file.outer_function(mutation.line)
        assert function is not None  # every place is in a function
        if function not in known:
            known[function] = [_does(file, file.lines[function.start : function.stop])]
        code = _does(file, mutated(file, function, mutation))
        if code is None:
            invalid += 1
        elif code == known[function][0]:
            equal += 1
        elif code in known[function]:
            twins += 1
        else:
            known[function].append(code)
            kept.append(mutation)
    return Distinct(mutations=tuple(kept), equal=equal, twins=twins, invalid=invalid)


def mutated(file: ParsedFile, function: range, mutation: Mutation) -> list[bytes]:
    before, place = list(file.lines[function.start : mutation.line]), mutation.place
    if isinstance(place, Expression):
        first, last = file.lines[place.start[0]], file.lines[place.end[0]]
        value = f"({mutation.now})".encode(file.encoding)
        line = first[: place.start[1]] + value + last[place.end[1] :]
        return [*before, line, *file.lines[place.end[0] + 1 : function.stop]]
    first = file.lines[place.first]
    indent = first[: len(first) - len(first.lstrip(b" \t\f"))]
    return [*before, indent + b"pass\n", *file.lines[place.last : function.stop]]


def _does(file: ParsedFile, lines: Iterable[bytes]) -> object:
    code = compiled_alone(list(lines), file.encoding)
    return code and essence(code)
