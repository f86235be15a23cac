"""Checks whether a changed file compiles by compiling only its changed functions."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

from mutator.mutants.changed_file_reuse import ReuseKey
from mutator.mutants.parsed_files_and_anchors import ParsedFile
from mutator.mutants.splicing import EditRank, LineEdit, apply_edits, mutated_bytes, sort_edits
from mutator.mutants.standalone_function_compilation import compile_standalone


def certainly_compiles_for_key(file: ParsedFile, edits: Iterable[LineEdit], key: ReuseKey) -> bool:
    """Return whether the file certainly compiles with these edits and with all others that have this key.

    True if the changed functions compile, both with these edits and with normalized ones, and the file
    compiles with the import of the probe. False is inconclusive.
    """
    unchanged = sort_edits(edits)
    normalized = [
        replace(edit, lines=tuple(text.encode(file.encoding).splitlines(keepends=True)))
        for edit, (*_, text) in zip(unchanged, key, strict=True)
    ]
    return all(_functions_and_rest_compile(file, some) for some in (unchanged, normalized))


def _functions_and_rest_compile(file: ParsedFile, edits: Iterable[LineEdit]) -> bool:
    functions: dict[range, list[LineEdit]] = defaultdict(list)
    outside: list[LineEdit] = []
    for edit in edits:
        function = file.outermost_function_at(
            edit.line_index - 1 if edit.rank is EditRank.AFTER_PREVIOUS_LINE else edit.line_index
        )
        if (
            function is None or edit.rank is EditRank.AFTER_WHOLE_STATEMENT
        ):  # such lines are between functions
            outside.append(edit)
        else:
            functions[function].append(edit)
    return _compiles_outside_functions(file, tuple(outside)) and all(
        _function_compiles(file, function, function_edits) for function, function_edits in functions.items()
    )


def _compiles_outside_functions(file: ParsedFile, outside: tuple[LineEdit, ...]) -> bool:
    """Return whether the file compiles with `outside`, and `outside` has at most the probe's import."""
    if len(outside) > 1 or any(edit.line_index != file.import_insertion_line_index for edit in outside):
        return False
    if outside not in file.verified_edits:
        try:
            compile(mutated_bytes(apply_edits(file, outside)), "<import>", "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError):
            return False
        file.verified_edits.add(outside)
    return True


def _function_compiles(file: ParsedFile, function: range, edits: Iterable[LineEdit]) -> bool:
    alone = replace(file, lines=file.lines[function.start : function.stop])
    moved = [replace(edit, line_index=edit.line_index - function.start) for edit in edits]
    data = mutated_bytes(apply_edits(alone, moved))
    return compile_standalone(data.splitlines(keepends=True), file.encoding) is not None
