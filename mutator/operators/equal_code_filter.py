"""Drops mutations whose function compiles to the same code as the original or an earlier mutation."""

from collections.abc import Iterable
from dataclasses import dataclass

from mutator.engines.code_swap import essence
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.expressions import Expression
from mutator.mutants.standalone_functions import compile_standalone
from mutator.operators.mutations import Mutation


@dataclass(frozen=True, slots=True, kw_only=True)
class DistinctMutations:
    """Mutations with distinct code, and the numbers of those left out."""

    mutations: tuple[Mutation, ...]
    equal: int  # same code as the original
    twins: int  # same code as an earlier mutation
    invalid: int  # does not compile


def drop_equal_code(file: ParsedFile, mutations: Iterable[Mutation]) -> DistinctMutations:
    """Keep a file's mutations whose active code differs from the original and from earlier mutations."""
    codes_by_function: dict[range, list[object]] = {}  # by function, the original's code first
    distinct_mutations: list[Mutation] = []
    equal_count = duplicate_count = invalid_count = 0
    for mutation in mutations:
        function = file.outermost_function_at(mutation.line)
        assert function is not None  # every place is in a function
        if function not in codes_by_function:
            codes_by_function[function] = [_comparable_code(file, file.lines[function.start : function.stop])]
        code = _comparable_code(file, mutated_function(file, function, mutation))
        if code is None:
            invalid_count += 1
        elif code == codes_by_function[function][0]:
            equal_count += 1
        elif code in codes_by_function[function]:
            duplicate_count += 1
        else:
            codes_by_function[function].append(code)
            distinct_mutations.append(mutation)
    return DistinctMutations(
        mutations=tuple(distinct_mutations), equal=equal_count, twins=duplicate_count, invalid=invalid_count
    )


def mutated_function(file: ParsedFile, function: range, mutation: Mutation) -> list[bytes]:
    before, part = list(file.lines[function.start : mutation.line]), mutation.place
    if isinstance(part, Expression):
        first, last = file.lines[part.start[0]], file.lines[part.end[0]]
        value = f"({mutation.now})".encode(file.encoding)
        line = first[: part.start[1]] + value + last[part.end[1] :]
        return [*before, line, *file.lines[part.end[0] + 1 : function.stop]]
    first = file.lines[part.first]
    indent = first[: len(first) - len(first.lstrip(b" \t\f"))]
    return [*before, indent + b"pass\n", *file.lines[part.last : function.stop]]


def _comparable_code(file: ParsedFile, lines: Iterable[bytes]) -> object:
    code = compile_standalone(list(lines), file.encoding)
    return code and essence(code)
