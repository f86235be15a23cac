"""Note where injected statements execute: before the first observation, in the run, or in a child process.

Standard library only. The probe of such a run has `PROBE_ADDITION` at its end, because a child process that
is not forked imports the probe by itself. The results of watched runs are not used.
"""

import importlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from types import FrameType, FunctionType, MethodType, ModuleType
from typing import Any

_MOST_STARTS = 1000  # lines that start processes
_WRAPPING_ATTRIBUTES = ("__func__", "fget", "fset", "fdel", "func", "__wrapped__")
# functions that start processes; `subprocess`, if it is loaded, has a copy of `fork_exec`
_STARTING_FUNCTIONS = (
    ("os", ("posix_spawn", "posix_spawnp", "system")),
    ("subprocess", ("_fork_exec",)),
    ("_posixsubprocess", ("fork_exec",)),
)
CHILD_FILE = "reached"  # in the folder that contains the tree
# `{up}` leads from the probe's folder to the one that contains the tree
PROBE_ADDITION = '''

import os as _os

_reach_decide = active
_reach_noted = set()


def active(fi):
    """Note a call in a child process of the run, once for each injection."""
    if fi not in _reach_noted:
        _reach_noted.add(fi)
        _folder = _os.path.dirname(_os.path.abspath(__file__))
        _path = _os.path.join(_folder, {up!r}, {file!r})
        _handle = _os.open(_path, _os.O_WRONLY | _os.O_APPEND | _os.O_CREAT, 0o644)
        _os.write(_handle, (fi + "\\n").encode())
        _os.close(_handle)
    return _reach_decide(fi)
'''


class ReachWatcher:
    """Watches the probe's calls in this process and in those that it starts.

    `places` has the file (relative to the tree) and the qualified name of the function of each statement.
    """

    def __init__(self, probe: Any, tree: str, places: Iterable[tuple[str, str]]) -> None:
        self._tree, self._probe, self._places = tree, probe, list(places)
        self._counts_before: dict[str, int] = {}
        self._starts: dict[tuple[str, int], int] = {}

    def begin(self) -> None:
        probe, in_child = self._probe, self._probe.active
        decide = probe._reach_decide

        def active(fi: str) -> Any:
            acts = decide(fi)
            if not acts:  # the trigger always holds, from the first observation on
                self._counts_before[fi] = self._counts_before.get(fi, 0) + 1
            return acts

        def begin_in_child() -> None:
            probe.active = in_child

        probe.active = active
        os.register_at_fork(before=self._note_start, after_in_child=begin_in_child)
        with suppress(ImportError):
            importlib.import_module("_posixsubprocess")
        for module, names in _STARTING_FUNCTIONS:
            owner = sys.modules.get(module)
            for name in names if owner else ():
                setattr(owner, name, self._noting(getattr(owner, name)))

    def as_json(self) -> dict[str, Any]:
        prefix = self._tree + os.sep
        files = [getattr(module, "__file__", None) or "" for module in list(sys.modules.values())]
        return {
            "before": self._counts_before,
            "children": _read_lines(Path(self._tree).parent / CHILD_FILE),
            "starts": [[file, line, count] for (file, line), count in self._starts.items()],
            "loaded": sorted({file.removeprefix(prefix) for file in files if file.startswith(prefix)}),
            "replaced": {
                f"{path}::{name}": text
                for path, name in self._places
                if (text := describe_replacement(self._tree, path, name))
            },
        }

    def _noting(self, start: Callable[..., Any]) -> Callable[..., Any]:
        def start_and_note(*args: Any, **named: Any) -> Any:
            self._note_start()
            return start(*args, **named)

        return start_and_note

    def _note_start(self) -> None:
        """Note the innermost line of the tree that starts a process."""
        frame: FrameType | None = sys._getframe()
        while frame is not None and not frame.f_code.co_filename.startswith(self._tree + os.sep):
            frame = frame.f_back
        if frame is not None and len(self._starts) < _MOST_STARTS:
            place = (os.path.relpath(frame.f_code.co_filename, self._tree), frame.f_lineno)
            self._starts[place] = self._starts.get(place, 0) + 1


def describe_replacement(tree: str, path: str, name: str) -> str:
    """Return what stands where a file's function should be, as `name (file:line)` or as a type; empty if the
    function is in its place, possibly in a wrapper, or if this cannot be said.
    """
    file = str(Path(tree) / path)
    for module in list(sys.modules.values()):
        if getattr(module, "__file__", None) != file:
            continue
        holder: Any = module
        for part in name.split("."):
            holder = vars(holder).get(part) if isinstance(holder, ModuleType | type) else None
        functions = list(_functions_inside(holder, set()))
        if holder is None or any(_is_function_of(function, file, name) for function in functions):
            continue
        if not functions:
            return "" if isinstance(holder, type) else f"an object of type {type(holder).__name__}"
        code = functions[0].__code__
        origin = code.co_filename.removeprefix(tree + os.sep)
        place = Path(origin).name if Path(origin).is_absolute() else origin
        return f"{code.co_qualname} ({place}:{code.co_firstlineno})"
    return ""


def _is_function_of(function: FunctionType, file: str, name: str) -> bool:
    code = function.__code__
    return code.co_filename == file and code.co_qualname.replace(".<locals>", "") == name


def _functions_inside(holder: Any, visited: set[int]) -> Iterator[FunctionType]:
    """Yield a function, then those that it, a method, a property or a wrapper contains."""
    if holder is None or isinstance(holder, type) or id(holder) in visited:
        return
    visited.add(id(holder))
    if isinstance(holder, FunctionType):
        yield holder
        for cell in holder.__closure__ or ():
            with suppress(ValueError):  # an empty cell
                if isinstance(cell.cell_contents, FunctionType | MethodType | staticmethod | classmethod):
                    yield from _functions_inside(cell.cell_contents, visited)
    for name in _WRAPPING_ATTRIBUTES:
        with suppress(Exception):  # a lazy attribute can fail in any way
            yield from _functions_inside(getattr(holder, name, None), visited)


def _read_lines(path: Path) -> list[str]:
    with suppress(OSError):
        return sorted(set(path.read_text(encoding="utf-8", errors="replace").split()))
    return []
