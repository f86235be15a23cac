"""Find the functions of a loaded program that a mutant changes, and check whether their code can be swapped.

No function of the target is running between two steps, so code can be swapped at that point. Until the
trigger first holds, the changed program acts like the pristine one, because the probe guards every inserted
statement.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from inspect import CO_ASYNC_GENERATOR, CO_COROUTINE, CO_GENERATOR, CO_OPTIMIZED
from types import CodeType

from mutator.errors import NotSwappable
from mutator.mutants.constant_imports import module_name
from mutator.mutants.injected_lines import has_value_settings, tag_of
from mutator.mutants.probe import Probe, probe_path
from mutator.mutants.splicing import unsplice
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches

_SUSPENDED = CO_GENERATOR | CO_COROUTINE | CO_ASYNC_GENERATOR
_IMPORT = re.compile(rb"\s*(?:from ([\w.]+) import|import ([\w.]+))")


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionSwap:
    """A function of `module`, before and after; `path`: the names that lead to it (class, method)."""

    module: str
    path: tuple[str, ...]
    old: CodeType
    new: CodeType


@dataclass(frozen=True, slots=True, kw_only=True)
class CodeSwap:
    """Everything that turns a loaded pristine program into the mutant.

    The two parts of `probe` run in order. `imports` are the modules that injected lines import. `settings`
    has, for each module, the code of its lines that set values in the probe. These modules must already be
    loaded, because loading a module runs those lines with the module's own constants.
    """

    functions: tuple[FunctionSwap, ...]
    settings: tuple[tuple[str, CodeType], ...]
    probe: tuple[CodeType, CodeType]
    imports: tuple[str, ...]


def plan_swap(manifest: TargetManifest, files: Mapping[str, bytes], probe: Probe, tree: str) -> CodeSwap:
    """Return what turns the pristine program, loaded from the folder `tree`, into the mutant with `files`.

    Raises NotSwappable if the result could differ from that mutant in a fresh interpreter.
    """
    functions: list[FunctionSwap] = []
    settings: list[tuple[str, CodeType]] = []
    imports: dict[str, None] = {}
    probe_file = probe_path(manifest.package)
    for path, data in files.items():
        if path == probe_file:
            continue
        if matches(path, manifest.reads_itself):
            raise NotSwappable(f"{path} is read by the run itself")
        if path not in manifest.tree.files:
            raise NotSwappable(f"{path} is a new file")
        found, needed = _in_file(path, manifest.tree.files[path], data, f"{tree}/{path}")
        functions += found
        settings += _settings(path, data, f"{tree}/{path}")
        imports |= dict.fromkeys(needed)
    own, shared = probe.settings_and_code
    name = f"{tree}/{probe_file}"
    # cached, because compiling the shared part takes ten times as long
    code = (compile(own, name, "exec", dont_inherit=True), _compiled(shared.encode(), name))
    return CodeSwap(functions=tuple(functions), settings=tuple(settings), probe=code, imports=tuple(imports))


@lru_cache(maxsize=256)  # cached, because all mutants change the observation's file, mostly in the same way
def _in_file(
    path: str, pristine: bytes, mutated: bytes, filename: str
) -> tuple[tuple[FunctionSwap, ...], tuple[str, ...]]:
    if unsplice(mutated) != pristine:
        raise NotSwappable(f"{path} differs by more than inserted lines")
    imports = _guarded_imports(path, mutated.splitlines())
    old, new = _compiled(pristine, filename), _compiled(_only(mutated, sets=False), filename)
    functions = [
        FunctionSwap(module=module_name(path), path=names, old=before, new=after)
        for names, before, after in changed_functions(old, new, path)
    ]
    return tuple(functions), imports


def _settings(path: str, mutated: bytes, filename: str) -> list[tuple[str, CodeType]]:
    if not has_value_settings(mutated):
        return []
    lines = _only(mutated, sets=True)
    return [(module_name(path), _compiled(lines, filename))] if lines.strip() else []


def _only(mutated: bytes, *, sets: bool) -> bytes:
    """Keep only a file's lines that set values in the probe, or only the others; line numbers stay."""
    if not sets and not has_value_settings(mutated):
        return mutated
    lines = mutated.splitlines(keepends=True)
    chosen = [((tag := tag_of(line)) is not None and tag.is_value_setting) is sets for line in lines]
    if all(chosen):
        return mutated
    return b"".join(
        (line.lstrip() if sets else line) if keep else b"\n" for line, keep in zip(lines, chosen, strict=True)
    )


@lru_cache(maxsize=64)
def _compiled(data: bytes, filename: str) -> CodeType:
    return compile(data, filename, "exec", dont_inherit=True)


def _guarded_imports(path: str, lines: list[bytes]) -> tuple[str, ...]:
    """Return the modules that injected lines import. NotSwappable if a block does not ask the probe first."""
    imports: list[str] = []
    before, margin = "", 0
    tags = [tag for line in lines if (tag := tag_of(line)) and tag.replaced_line is not None]
    if {name for tag in tags for name in tag.ids} != {name for tag in tags for name in tag.changed_value_ids}:
        raise NotSwappable(f"{path} has a changed value that does not ask the probe first")
    for line in lines:
        tag = tag_of(line)
        if tag and tag.is_of_fault and tag.replaced_line is None and not tag.is_value_setting:
            indent = len(tag.code) - len(tag.code.lstrip())
            if tag.id == before and indent == margin and tag.is_else_of_guard:
                before = ""  # the next injected lines must ask the probe again
                continue
            if tag.id != before or indent <= margin:
                margin = indent
                if not tag.is_guard:
                    raise NotSwappable(f"{path} has an injected statement that does not ask the probe first")
            elif found := _IMPORT.match(tag.code):
                imports.append((found[1] or found[2]).decode())
        before = tag.id if tag else ""
    return tuple(imports)


def changed_functions(
    old: CodeType, new: CodeType, path: str, names: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], CodeType, CodeType]]:
    """Yield names, old code and new code of the functions that differ between two bodies of a module or
    class.

    Raises NotSwappable if anything except functions differs.
    """
    before, after = _inner(old), _inner(new)
    if [code.co_name for code in before] != [code.co_name for code in after]:
        raise NotSwappable(f"{path} is changed outside its functions")
    for one, other in zip(before, after, strict=True):
        here = (*names, one.co_name)
        if not one.co_flags & CO_OPTIMIZED:  # a class body
            if (one.co_names, one.co_freevars, one.co_cellvars) != (
                other.co_names,
                other.co_freevars,
                other.co_cellvars,
            ):
                raise NotSwappable(f"the body of class {'.'.join(here)} in {path} is changed")
            yield from changed_functions(one, other, path, here)
        elif not same(one, other):
            _check(one, other, f"{'.'.join(here)} in {path}")
            yield here, one, other


def _check(old: CodeType, new: CodeType, name: str) -> None:
    """Raise NotSwappable unless the new code acts like the old until a trigger holds."""
    if old.co_name.startswith("<"):
        raise NotSwappable(f"{name} is a function without a name")
    if new.co_flags & _SUSPENDED:
        raise NotSwappable(f"{name} may be suspended between two steps")
    if _signature(old) != _signature(new):
        raise NotSwappable(f"{name} has another signature, or other variables of an outer function")
    before = _inner(old)
    if len(before) > sum(any(same(one, other) for other in _inner(new)) for one in before):
        raise NotSwappable(f"a function inside {name} is changed")


def _signature(code: CodeType) -> tuple[object, ...]:
    count = code.co_argcount + code.co_kwonlyargcount
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    return (*counts, code.co_varnames[:count], code.co_flags, code.co_freevars)


def _inner(code: CodeType) -> list[CodeType]:
    return [const for const in code.co_consts if isinstance(const, CodeType)]


def same(one: CodeType, other: CodeType) -> bool:
    return essence(one) == essence(other)


def essence(code: CodeType) -> tuple[object, ...]:
    """Return a key for what the code does. Functions that do the same have equal keys."""
    return (*_essence(code), *map(essence, _inner(code)))


def _essence(code: CodeType) -> tuple[object, ...]:
    values = tuple((type(c), None if isinstance(c, CodeType) else repr(c)) for c in code.co_consts)
    names = (code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return (*names, _signature(code), code.co_code, code.co_exceptiontable, values)
