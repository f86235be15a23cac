"""Note which lines of a tree run from the first observation on. Standard library only.

In Python 3.12 and later, `sys.monitoring` reports each line once. In older versions, the tree's functions are
traced, which is slower and misses other threads.
"""

import os
import sys
from collections.abc import Iterable
from types import CodeType, FrameType
from typing import Any

_monitoring: Any = getattr(sys, "monitoring", None)
_TOOL = 1  # the tool id that `sys.monitoring` reserves for coverage


class Lines:
    """Notes the lines of the tree `tree` that run, beginning when a line in `since` of the file `path` runs.

    A fault cannot act in lines that run only before that.
    """

    def __init__(self, tree: str, path: str, since: Iterable[int]) -> None:
        self._tree = tree + os.sep
        self._path, self._since = self._tree + path, frozenset(since)
        self._noted: set[tuple[str, int]] = set()
        self._begun = False

    def begin(self) -> None:
        if _monitoring:
            _monitoring.use_tool_id(_TOOL, "mutator")
            _monitoring.register_callback(_TOOL, _monitoring.events.LINE, self._monitor)
            _monitoring.set_events(_TOOL, _monitoring.events.LINE)
        else:
            sys.settrace(self._trace)

    def found(self) -> dict[str, list[int]]:
        """Stop noting; return the lines of each file, counted from 1, in order."""
        if _monitoring:
            _monitoring.set_events(_TOOL, 0)
            _monitoring.free_tool_id(_TOOL)
        else:
            sys.settrace(None)
        files: dict[str, list[int]] = {}
        for file, line in sorted(self._noted) if self._begun else ():
            files.setdefault(file.removeprefix(self._tree), []).append(line)
        return files

    def _note(self, file: str, line: int) -> bool:
        """Note a line of the tree. At the first observation, discard earlier lines and return True."""
        first = not self._begun and file == self._path and line in self._since
        if first:
            self._begun = True
            self._noted.clear()
        self._noted.add((file, line))
        return first

    def _monitor(self, code: CodeType, line: int) -> Any:
        if code.co_filename.startswith(self._tree) and self._note(code.co_filename, line):
            _monitoring.restart_events()
        return _monitoring.DISABLE

    def _trace(self, frame: FrameType, event: str, what: Any) -> Any:
        return self._of_tree if frame.f_code.co_filename.startswith(self._tree) else None

    def _of_tree(self, frame: FrameType, event: str, what: Any) -> Any:
        if event == "line":
            self._note(frame.f_code.co_filename, frame.f_lineno)
        return self._of_tree
