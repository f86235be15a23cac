"""Drops mutations whose function compiles to the same code as the original or an earlier mutation."""

from collections.abc import Iterable
from dataclasses import dataclass

from mutator.engines.code_swap_planning import behaviour_key
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.expressions import Expression
from mutator.mutants.standalone_compilation import compile_standalone
from mutator.operators.mutations import Mutation


@dataclass(frozen=True, slots=True, kw_only=True)
class DistinctAndEqualMutations:
    """Mutations with distinct code, and the numbers of those left out."""

    mutations: tuple[Mutation, ...]
    equal_to_original_count: int  # same code as the original
    duplicate_count: int  # same code as an earlier mutation
    invalid_count: int  # does not compile


def drop_equal_code(file: ParsedFile, mutations: Iterable[Mutation]) -> DistinctAndEqualMutations:
    """Keep a file's mutations whose active code differs from the original and from earlier mutations."""
    codes_by_function: dict[range, list[object]] = {}  # by function, the original's code first
    distinct_mutations: list[Mutation] = []
    equals = duplicates = invalids = 0
    for mutation in mutations:
        function = file.outermost_function_at(mutation.line)
        assert function is not None  # every place is in a function
        if function not in codes_by_function:
            codes_by_function[function] = [_comparable_code(file, file.lines[function.start : function.stop])]
        code = _comparable_code(file, mutated_function_lines(file, function, mutation))
        if code is None:
            invalids += 1
        elif code == codes_by_function[function][0]:
            equals += 1
        elif code in codes_by_function[function]:
            duplicates += 1
        else:
            codes_by_function[function].append(code)
            distinct_mutations.append(mutation)
    return DistinctAndEqualMutations(
        mutations=tuple(distinct_mutations),
        equal_to_original_count=equals,
        duplicate_count=duplicates,
        invalid_count=invalids,
    )


def mutated_function_lines(file: ParsedFile, function: range, mutation: Mutation) -> list[bytes]:
    before, part = list(file.lines[function.start : mutation.line]), mutation.mutated_part
    if isinstance(part, Expression):
        first, last = file.lines[part.start[0]], file.lines[part.end[0]]
        value = f"({mutation.source_after})".encode(file.encoding)
        line = first[: part.start[1]] + value + last[part.end[1] :]
        return [*before, line, *file.lines[part.end[0] + 1 : function.stop]]
    first = file.lines[part.first_line]
    indent = first[: len(first) - len(first.lstrip(b" \t\f"))]
    return [*before, indent + b"pass\n", *file.lines[part.end_line : function.stop]]


def _comparable_code(file: ParsedFile, lines: Iterable[bytes]) -> object:
    code = compile_standalone(list(lines), file.encoding)
    return code and behaviour_key(code)
