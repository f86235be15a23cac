"""What a mutant changes in a loaded program: functions whose code can be exchanged, or why it cannot.

A mutant's files differ from the pristine ones by inserted lines alone, so whatever stands outside functions
is the same but for the import of the probe. Between two steps of a run no function of the target is at work:
the code of the changed ones can then be exchanged in place, and all that holds them (methods, closures, names
imported elsewhere) goes on with the new code. Until its trigger first holds, such a program does what the
pristine one does: every inserted statement is guarded by the probe, and none hides a name.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from inspect import CO_ASYNC_GENERATOR, CO_COROUTINE, CO_GENERATOR, CO_OPTIMIZED
from types import CodeType

from mutator.mutants.anchors import TAG
from mutator.mutants.building import OBSERVE_TAG, unsplice
from mutator.mutants.splicing import PROBE_TAG
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches

_SUSPENDED = CO_GENERATOR | CO_COROUTINE | CO_ASYNC_GENERATOR
_GUARD = re.compile(rb'\s*if (not )?_fi\.active\("[0-9a-z]+"\)( or _fi\.steps\(\))?:\Z')
_IMPORT = re.compile(rb"\s*(?:from ([\w.]+) import|import ([\w.]+))")


class NotExchangeable(Exception):
    """The mutant cannot be put into a running program; the text says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """A function of a module, by the names that lead to it (class, method), and its code before and after."""

    module: str
    path: tuple[str, ...]
    old: CodeType
    new: CodeType


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """All that makes a loaded pristine program the mutant. `imports` are modules that injected lines import;
    they may be loaded beforehand."""

    functions: tuple[Function, ...]
    probe: CodeType
    imports: tuple[str, ...]


def exchange(manifest: TargetManifest, files: Mapping[str, bytes], tree: str) -> Exchange:
    """The exchange that makes the pristine tree in the folder `tree`, loaded, the mutant with these `files`.

    NotExchangeable when there is none that is sure to do the same.
    """
    functions: list[Function] = []
    imports: dict[str, None] = {}
    for path, data in files.items():
        if path == manifest.probe_path:
            continue
        if matches(path, manifest.reads_itself):
            raise NotExchangeable(f"{path} is read by the run itself")
        if path not in manifest.tree.files:
            raise NotExchangeable(f"{path} is a new file")
        found, needed = _in_file(path, manifest.tree.files[path], data, f"{tree}/{path}")
        functions += found
        imports |= dict.fromkeys(needed)
    if manifest.probe_path not in files:
        raise NotExchangeable("there is no probe")
    probe = _compiled(files[manifest.probe_path], f"{tree}/{manifest.probe_path}")
    return Exchange(functions=tuple(functions), probe=probe, imports=tuple(imports))


@lru_cache(maxsize=64)  # every mutant changes the file that observes, most of them in no other way
def _in_file(
    path: str, pristine: bytes, mutated: bytes, filename: str
) -> tuple[tuple[Function, ...], tuple[str, ...]]:
    """The changed functions of one file, and what its injected lines import."""
    if unsplice(mutated) != pristine:
        raise NotExchangeable(f"{path} differs by more than inserted lines")
    imports = _guarded(path, mutated.splitlines())
    module = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    old, new = _compiled(pristine, filename), _compiled(mutated, filename)
    functions = [
        Function(module=module, path=names, old=before, new=after)
        for names, before, after in _changed(old, new, (), path)
    ]
    return tuple(functions), imports


@lru_cache(maxsize=64)
def _compiled(data: bytes, filename: str) -> CodeType:
    return compile(data, filename, "exec", dont_inherit=True)


def _guarded(path: str, lines: list[bytes]) -> tuple[str, ...]:
    """The modules that injected lines import; NotExchangeable unless all of them wait for the probe."""
    imports: list[str] = []
    before, margin = b"", 0
    for line in lines:
        match = TAG.search(line)
        tag = match[1] if match else b""
        if match and tag.decode() not in (PROBE_TAG, OBSERVE_TAG):
            code = line[: match.start()]
            indent = len(code) - len(code.lstrip())
            if tag != before or indent <= margin:
                margin = indent
                if not _GUARD.match(code):
                    raise NotExchangeable(
                        f"{path} has an injected statement that does not ask the probe first"
                    )
            elif found := _IMPORT.match(code):
                imports.append((found[1] or found[2]).decode())
        before = tag
    return tuple(imports)


def _changed(
    old: CodeType, new: CodeType, names: tuple[str, ...], path: str
) -> Iterator[tuple[tuple[str, ...], CodeType, CodeType]]:
    """The functions that differ below a module or class body."""
    before, after = _inner(old), _inner(new)
    if [code.co_name for code in before] != [code.co_name for code in after]:
        raise NotExchangeable(f"{path} is changed outside its functions")
    for one, other in zip(before, after, strict=True):
        here = (*names, one.co_name)
        if not one.co_flags & CO_OPTIMIZED:  # a class body
            if (one.co_names, one.co_freevars, one.co_cellvars) != (
                other.co_names,
                other.co_freevars,
                other.co_cellvars,
            ):
                raise NotExchangeable(f"the body of class {'.'.join(here)} in {path} is changed")
            yield from _changed(one, other, here, path)
        elif not same(one, other):
            _check(one, other, f"{'.'.join(here)} in {path}")
            yield here, one, other


def _check(old: CodeType, new: CodeType, name: str) -> None:
    """NotExchangeable unless a function's code can be `new` from now on, with no difference before a trigger
    holds."""
    if old.co_name.startswith("<"):
        raise NotExchangeable(f"{name} is a function without a name")
    if new.co_flags & _SUSPENDED:
        raise NotExchangeable(f"{name} may be suspended between two steps")
    if _signature(old) != _signature(new):
        raise NotExchangeable(f"{name} has another signature, or other variables of an outer function")
    before = _inner(old)
    if len(before) > sum(any(same(one, other) for other in _inner(new)) for one in before):
        raise NotExchangeable(f"{name} has a function in it that is changed")
    hidden = (_locals(new) - _locals(old)) & _read(old)
    if hidden:
        raise NotExchangeable(f"{name} reads '{min(hidden)}' from outside, which an injected statement sets")


def _signature(code: CodeType) -> tuple[object, ...]:
    count = code.co_argcount + code.co_kwonlyargcount
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    return (*counts, code.co_varnames[:count], code.co_flags, code.co_freevars)


def _locals(code: CodeType) -> set[str]:
    return {*code.co_varnames, *code.co_cellvars}


def _read(code: CodeType) -> set[str]:
    """Names that the function, or one inside it, takes from outside (attributes' names among them)."""
    return {*code.co_names, *code.co_freevars}.union(*map(_read, _inner(code)))


def _inner(code: CodeType) -> list[CodeType]:
    return [const for const in code.co_consts if isinstance(const, CodeType)]


def same(one: CodeType, other: CodeType) -> bool:
    """Whether two functions do the same, wherever their lines stand."""
    if _essence(one) != _essence(other):
        return False
    before, after = _inner(one), _inner(other)
    return len(before) == len(after) and all(map(same, before, after))


def _essence(code: CodeType) -> tuple[object, ...]:
    """What a function's code does, without its lines and without the functions in it."""
    values = [(type(c), None if isinstance(c, CodeType) else repr(c)) for c in code.co_consts]
    names = (code.co_name, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return (*names, _signature(code), code.co_code, code.co_exceptiontable, values)
