"""Drops mutations whose function compiles to the same code as the original or an earlier mutation."""

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

from mutator.engines.code_swap_planning import behaviour_key
from mutator.mutants.changeable_expressions import Expression
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.standalone_function_compilation import compile_standalone
from mutator.operators.changed_part_compilation import ChangeableParts
from mutator.operators.mutations import Mutation


@dataclass(frozen=True, slots=True, kw_only=True)
class DistinctAndEqualMutations:
    """Mutations with distinct code, and the numbers of those left out."""

    mutations: tuple[Mutation, ...]
    equal_to_original_count: int  # same code as the original
    duplicate_count: int  # same code as an earlier mutation
    invalid_count: int  # does not compile


def drop_equal_code(file: ParsedFile, mutations: Sequence[Mutation]) -> DistinctAndEqualMutations:
    """Keep a file's mutations whose active code differs from the original and from earlier mutations."""
    distinct_mutations: list[Mutation] = []
    equals = duplicates = invalids = 0
    earlier: set[Hashable] = set()
    for mutation, codes in zip(mutations, _compared_codes(file, mutations), strict=True):
        key = (codes.place, codes.mutated)
        if codes.mutated is None:
            invalids += 1
        elif codes.mutated == codes.original:
            equals += 1
        elif key in earlier:
            duplicates += 1
        else:
            earlier.add(key)
            distinct_mutations.append(mutation)
    return DistinctAndEqualMutations(
        mutations=tuple(distinct_mutations),
        equal_to_original_count=equals,
        duplicate_count=duplicates,
        invalid_count=invalids,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _ComparedCode:
    """The code of a place without and with a mutation; None if it does not compile."""

    place: Hashable
    original: Hashable
    mutated: Hashable | None


def _compared_codes(file: ParsedFile, mutations: Sequence[Mutation]) -> list[_ComparedCode]:
    """Return what to compare for each mutation: the code of a part of its function, if that is enough."""
    parts, functions = ChangeableParts(file), _WholeFunctionCode(file)
    numbers_by_part: dict[Hashable, list[int]] = defaultdict(list)
    changed_parts = [parts.part_of(mutation) for mutation in mutations]
    for number, part in enumerate(changed_parts):
        numbers_by_part[part.key].append(number)
    result: dict[int, _ComparedCode] = {}
    for key, numbers in numbers_by_part.items():
        codes = parts.compared_codes([(changed_parts[number], mutations[number]) for number in numbers])
        for i, number in enumerate(numbers, start=1):
            result[number] = (
                functions.compared_code(mutations[number])
                if codes is None
                else _ComparedCode(place=key, original=codes[0], mutated=codes[i])
            )
    return [result[number] for number in range(len(mutations))]


class _WholeFunctionCode:
    """The code of whole functions."""

    def __init__(self, file: ParsedFile) -> None:
        self._file = file
        self._original_codes: dict[range, Hashable] = {}

    def compared_code(self, mutation: Mutation) -> _ComparedCode:
        file, function = self._file, self._file.outermost_function_at(mutation.line)
        assert function is not None  # every place is in a function
        if function not in self._original_codes:
            lines = file.lines[function.start : function.stop]
            self._original_codes[function] = _comparable_code(file, lines)
        return _ComparedCode(
            place=function,
            original=self._original_codes[function],
            mutated=_comparable_code(file, mutated_function_lines(file, function, mutation)),
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


def _comparable_code(file: ParsedFile, lines: Iterable[bytes]) -> Hashable | None:
    code = compile_standalone(list(lines), file.encoding)
    return code and behaviour_key(code)
