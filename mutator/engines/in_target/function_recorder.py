"""Note which functions of a tree run, for `mutator run --since`. Standard library only.

`sys.monitoring` (Python 3.12 and later) reports the first call of each function, and then no more, so this
costs next to nothing. A fork inherits what was noted before. An audit hook notes what the calls do not show.
"""

import os
import sys
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

_monitoring: Any = getattr(sys, "monitoring", None)
# none of the ids that are reserved for debuggers, coverage and profilers, which a target can use itself
_TOOL_ID = 4
_HARNESS_FOLDER = str(Path(__file__).resolve().parent) + os.sep
_IMPORT_SYSTEM_PREFIX = "<frozen importlib"
_PROCESS_STARTING_EVENTS = frozenset(
    ("os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.system", "subprocess.Popen")
)
# `multiprocessing` imports these when it starts a process, of which there is no event
_PROCESS_STARTING_MODULES = ("multiprocessing.popen_forkserver", "multiprocessing.popen_spawn_posix")


class FunctionRecorder:
    """Notes the functions of the tree `tree` that run in this process, in any thread."""

    def __init__(self, tree: str) -> None:
        self._prefix = tree + os.sep
        self._names: set[tuple[str, str]] = set()  # file and qualified name
        self._files_read: set[str] = set()
        self._functions_being_noted: set[int] = set()
        self._obstacle = ""

    def begin(self) -> None:
        """Begin to note; in an older Python, do nothing."""
        if not _monitoring:
            return
        _monitoring.use_tool_id(_TOOL_ID, "mutator")
        _monitoring.register_callback(_TOOL_ID, _monitoring.events.PY_START, self._on_start)
        _monitoring.set_events(_TOOL_ID, _monitoring.events.PY_START)
        sys.addaudithook(self._on_audit_event)

    def as_json(self) -> dict[str, Any] | None:
        """Return what was noted; None in an older Python.

        * `functions`: by file of the tree the names of its functions, without those inside of functions
        * `read`: the Python files of the tree that were read other than by an import
        * `obstacle`: why this cannot be all that ran; empty if it is
        """
        if not _monitoring:
            return None
        functions: dict[str, dict[str, None]] = {}
        for file, name in sorted(self._names):
            functions.setdefault(file.removeprefix(self._prefix), {})[name.partition(".<locals>")[0]] = None
        started = any(name in sys.modules for name in _PROCESS_STARTING_MODULES)
        return {
            "functions": {file: list(names) for file, names in functions.items()},
            "read": sorted(file.removeprefix(self._prefix) for file in self._files_read),
            "obstacle": self._obstacle or ("it starts other processes" if started else ""),
        }

    def _on_start(self, code: CodeType, offset: int) -> Any:
        self._note_code(code)
        return _monitoring.DISABLE

    def _note_code(self, code: CodeType) -> None:
        if code.co_filename.startswith(self._prefix):
            self._names.add((code.co_filename, code.co_qualname))

    def _on_audit_event(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            file = arguments[0]
            if isinstance(file, str) and file.endswith(".py"):
                self._note_reading(file, sys._getframe(1).f_code.co_filename)
        elif event == "object.__getattr__":
            if arguments[1] == "__code__" and isinstance(arguments[0], FunctionType):
                self._note_reading_of_code(arguments[0])
        elif event == "exec":
            is_by_tree = sys._getframe(1).f_code.co_filename.startswith(self._prefix)
            if is_by_tree and not arguments[0].co_filename.startswith(self._prefix):
                self._obstacle = "it executes text as code"
        elif event in _PROCESS_STARTING_EVENTS and not _is_called_by_harness():
            self._obstacle = "it starts other processes"

    def _note_reading_of_code(self, function: FunctionType) -> None:
        """Note a function whose code somebody reads, to compile it or to choose by it."""
        # reading the code here calls the hook again
        if id(function) not in self._functions_being_noted and not _is_called_by_harness():
            self._functions_being_noted.add(id(function))
            self._note_code(function.__code__)
            self._functions_being_noted.discard(id(function))

    def _note_reading(self, file: str, reader: str) -> None:
        path = os.path.abspath(file)  # noqa: PTH100 - links stay: code has the path by which it was imported
        if path.startswith(self._prefix) and not reader.startswith(_IMPORT_SYSTEM_PREFIX):
            self._files_read.add(path)


def _is_called_by_harness() -> bool:
    """Return whether the innermost function outside of this file is one of the harness."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame = frame.f_back
    return frame.f_code.co_filename.startswith(_HARNESS_FOLDER)
