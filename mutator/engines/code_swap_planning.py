"""Find the functions of a loaded program that a mutant changes, and check whether their code can be swapped.

No function of the target is running between two steps, so code can be swapped at that point. Until the
trigger first holds, the changed program acts like the pristine one, because the probe guards every inserted
statement.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from dis import hasconst
from functools import lru_cache
from inspect import CO_ASYNC_GENERATOR, CO_COROUTINE, CO_GENERATOR, CO_OPTIMIZED
from types import CodeType

from mutator.errors import MutantNotSwappable
from mutator.mutants.injected_line_syntax import has_constant_or_default_settings, tag_of
from mutator.mutants.modules_importing_constants import module_name
from mutator.mutants.probe_contract import ProbeSource, probe_path
from mutator.mutants.splicing import unsplice
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches_any_glob

# what is suspended between two steps goes on with its old code, which a swap does not reach
_SUSPENDABLE_FLAGS = CO_GENERATOR | CO_COROUTINE | CO_ASYNC_GENERATOR
_IMPORT_PATTERN = re.compile(rb"\s*(?:from ([\w.]+) import|import ([\w.]+))")


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionSwap:
    """A function of `module`, before and after; `name_path`: the names that lead to it (class, method)."""

    module: str
    name_path: tuple[str, ...]
    old_code: CodeType
    new_code: CodeType


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeSwap:
    """Everything that turns a loaded pristine program into the mutant.

    The two parts of `probe_code` run in order. `imported_modules` are those that injected lines import.
    `probe_value_setters` has, for each module, the code of its lines that set values in the probe. These
    modules must already be loaded, because loading a module runs those lines with the module's own constants.
    """

    functions: tuple[FunctionSwap, ...]
    probe_value_setters: tuple[tuple[str, CodeType], ...]
    probe_code: tuple[CodeType, CodeType]
    imported_modules: tuple[str, ...]


def plan_swap(
    manifest: TargetManifest, mutated_files: Mapping[str, bytes], probe: ProbeSource, tree_folder: str
) -> CodeSwap:
    """Return what turns the pristine program, loaded from the folder `tree`, into the mutant with `files`.

    Raises MutantNotSwappable if the result could differ from that mutant in a fresh interpreter.
    """
    functions: list[FunctionSwap] = []
    settings: list[tuple[str, CodeType]] = []
    imports: dict[str, None] = {}
    probe_file = probe_path(manifest.probe_package)
    for path, data in mutated_files.items():
        if path == probe_file:
            continue
        if matches_any_glob(path, manifest.globs_read_by_runs):
            raise MutantNotSwappable(f"{path} is read by the run itself")
        if path not in manifest.tree.files:
            raise MutantNotSwappable(f"{path} is a new file")
        swaps, imported = _swaps_and_imports_of_file(
            path, manifest.tree.files[path], data, f"{tree_folder}/{path}"
        )
        functions += swaps
        settings += _probe_value_setters_of_file(path, data, f"{tree_folder}/{path}")
        imports |= dict.fromkeys(imported)
    mutant_part, shared_part = probe.settings_and_code
    name = f"{tree_folder}/{probe_file}"
    # cached, because compiling the shared part takes ten times as long
    code = (
        compile(mutant_part, name, "exec", dont_inherit=True),
        _compile_cached(shared_part.encode(), name),
    )
    return CodeSwap(
        functions=tuple(functions),
        probe_value_setters=tuple(settings),
        probe_code=code,
        imported_modules=tuple(imports),
    )


@lru_cache(maxsize=256)  # cached, because all mutants change the observation's file, mostly in the same way
def _swaps_and_imports_of_file(
    path: str, pristine: bytes, mutated: bytes, filename: str
) -> tuple[tuple[FunctionSwap, ...], tuple[str, ...]]:
    if unsplice(mutated) != pristine:
        raise MutantNotSwappable(f"{path} differs by more than inserted lines")
    imports = _imports_of_injected_lines(path, mutated.splitlines())
    old, new = (
        _compile_cached(pristine, filename),
        _compile_cached(_keep_lines(mutated, value_setters=False), filename),
    )
    functions = [
        FunctionSwap(module=module_name(path), name_path=names, old_code=before, new_code=after)
        for names, before, after in changed_functions(old, new, path)
    ]
    return tuple(functions), imports


def _probe_value_setters_of_file(path: str, mutated: bytes, filename: str) -> list[tuple[str, CodeType]]:
    if not has_constant_or_default_settings(mutated):
        return []
    lines = _keep_lines(mutated, value_setters=True)
    return [(module_name(path), _compile_cached(lines, filename))] if lines.strip() else []


def _keep_lines(mutated: bytes, *, value_setters: bool) -> bytes:
    """Keep only a file's lines that set values in the probe, or only the others; line numbers stay."""
    if not value_setters and not has_constant_or_default_settings(mutated):
        return mutated
    lines = mutated.splitlines(keepends=True)
    chosen = [
        ((tag := tag_of(line)) is not None and tag.is_constant_or_default_setting) is value_setters
        for line in lines
    ]
    if all(chosen):
        return mutated
    return b"".join(
        (line.lstrip() if value_setters else line) if keep else b"\n"
        for line, keep in zip(lines, chosen, strict=True)
    )


@lru_cache(maxsize=64)
def _compile_cached(data: bytes, filename: str) -> CodeType:
    return compile(data, filename, "exec", dont_inherit=True)


def _imports_of_injected_lines(path: str, lines: list[bytes]) -> tuple[str, ...]:
    """Return the modules that injected lines import. MutantNotSwappable if a block does not ask the probe
    first.
    """
    imports: list[str] = []
    before, margin = "", 0
    tags = [tag for line in lines if (tag := tag_of(line)) and tag.replaced_line is not None]
    if {name for tag in tags for name in tag.ids} != {name for tag in tags for name in tag.changed_value_ids}:
        raise MutantNotSwappable(f"{path} has a changed value that does not ask the probe first")
    for line in lines:
        tag = tag_of(line)
        if tag and tag.is_of_fault and tag.replaced_line is None and not tag.is_constant_or_default_setting:
            indent = len(tag.line_without_tag) - len(tag.line_without_tag.lstrip())
            if tag.id == before and indent == margin and tag.is_else_of_guard:
                before = ""  # the next injected lines must ask the probe again
                continue
            if tag.id != before or indent <= margin:
                margin = indent
                if not tag.is_guard:
                    raise MutantNotSwappable(
                        f"{path} has an injected statement that does not ask the probe first"
                    )
            elif match := _IMPORT_PATTERN.match(tag.line_without_tag):
                imports.append((match[1] or match[2]).decode())
        before = tag.id if tag else ""
    return tuple(imports)


def changed_functions(
    old: CodeType, new: CodeType, path: str, names: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], CodeType, CodeType]]:
    """Yield names, old code and new code of the functions that differ between two bodies of a module or
    class.

    Raises MutantNotSwappable if anything except functions differs.
    """
    old_functions, new_functions = nested_code(old), nested_code(new)
    if [code.co_name for code in old_functions] != [code.co_name for code in new_functions]:
        raise MutantNotSwappable(f"{path} is changed outside its functions")
    for old_function, new_function in zip(old_functions, new_functions, strict=True):
        function_path = (*names, old_function.co_name)
        if not old_function.co_flags & CO_OPTIMIZED:  # a class body
            if (old_function.co_names, old_function.co_freevars, old_function.co_cellvars) != (
                new_function.co_names,
                new_function.co_freevars,
                new_function.co_cellvars,
            ):
                raise MutantNotSwappable(f"the body of class {'.'.join(function_path)} in {path} is changed")
            yield from changed_functions(old_function, new_function, path, function_path)
        elif not has_same_behaviour(old_function, new_function):
            _check_swappable(old_function, new_function, f"{'.'.join(function_path)} in {path}")
            yield function_path, old_function, new_function


def _check_swappable(old: CodeType, new: CodeType, described_function: str) -> None:
    """Raise MutantNotSwappable unless the new code acts like the old until a trigger holds."""
    if old.co_name.startswith("<"):
        raise MutantNotSwappable(f"{described_function} is a function without a name")
    if new.co_flags & _SUSPENDABLE_FLAGS:
        raise MutantNotSwappable(f"{described_function} may be suspended between two steps")
    if _signature(old) != _signature(new):
        raise MutantNotSwappable(
            f"{described_function} has another signature, or other variables of an outer function"
        )
    before = nested_code(old)
    # injected lines may add functions, but each old one must still be there
    if len(before) > sum(
        any(has_same_behaviour(nested, new_nested) for new_nested in nested_code(new)) for nested in before
    ):
        raise MutantNotSwappable(f"a function inside {described_function} is changed")


def _signature(code: CodeType) -> tuple[object, ...]:
    count = code.co_argcount + code.co_kwonlyargcount
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    return (*counts, code.co_varnames[:count], code.co_flags, code.co_freevars)


def nested_code(code: CodeType) -> list[CodeType]:
    return [const for const in code.co_consts if isinstance(const, CodeType)]


def has_same_behaviour(first: CodeType, second: CodeType) -> bool:
    return behaviour_key(first) == behaviour_key(second)


def behaviour_key(code: CodeType) -> tuple[object, ...]:
    """Return a key for what the code does. Functions that do the same have equal keys."""
    return (*_behaviour_key_without_nested(code), *map(behaviour_key, nested_code(code)))


def _behaviour_key_without_nested(code: CodeType) -> tuple[object, ...]:
    # types and texts, because 1 == True and 0.0 == -0.0; no line numbers, because insertions move lines
    values = tuple(
        (type(c), None if isinstance(c, CodeType) else repr(c)) for c in _constants_that_matter(code)
    )
    names = (code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return (*names, _signature(code), code.co_code, code.co_exceptiontable, values)


def _constants_that_matter(code: CodeType) -> tuple[object, ...]:
    """Return the constants, but without a first one that is no docstring and that nothing loads.

    Since Python 3.14, the compiler keeps it: `while False` differs from `while not True` in nothing else.
    """
    constants = code.co_consts
    instructions = zip(code.co_code[::2], code.co_code[1::2], strict=True)
    is_first_loaded = any(operation in hasconst and index == 0 for operation, index in instructions)
    if not constants or is_first_loaded or isinstance(constants[0], str):
        return constants
    return (None, *constants[1:])
