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
_COVERAGE_TOOL_ID = 1  # the tool id that `sys.monitoring` reserves for coverage


class LineRecorder:
    """Notes the lines of the tree `tree` that run, from the first observation on.

    It begins when one of the `observation_lines` of `observation_file` runs.
    A fault cannot act in lines that run only before that.
    """

    def __init__(self, tree: str, observation_file: str, observation_lines: Iterable[int]) -> None:
        self._tree = tree + os.sep
        self._observation_file, self._observation_lines = (
            self._tree + observation_file,
            frozenset(observation_lines),
        )
        self._noted_lines: set[tuple[str, int]] = set()
        self._has_begun = False

    def begin(self) -> None:
        if _monitoring:
            _monitoring.use_tool_id(_COVERAGE_TOOL_ID, "mutator")
            _monitoring.register_callback(_COVERAGE_TOOL_ID, _monitoring.events.LINE, self._on_monitored_line)
            _monitoring.set_events(_COVERAGE_TOOL_ID, _monitoring.events.LINE)
        else:
            sys.settrace(self._on_traced_call)

    def stop_and_collect(self) -> dict[str, list[int]]:
        """Stop noting; return the lines of each file, counted from 1, in order."""
        if _monitoring:
            _monitoring.set_events(_COVERAGE_TOOL_ID, 0)
            _monitoring.free_tool_id(_COVERAGE_TOOL_ID)
        else:
            sys.settrace(None)
        files: dict[str, list[int]] = {}
        for file, line in sorted(self._noted_lines) if self._has_begun else ():
            files.setdefault(file.removeprefix(self._tree), []).append(line)
        return files

    def _note_line(self, file: str, line: int) -> bool:
        """Note a line of the tree. At the first observation, discard earlier lines and return True."""
        first = not self._has_begun and file == self._observation_file and line in self._observation_lines
        if first:
            self._has_begun = True
            self._noted_lines.clear()
        self._noted_lines.add((file, line))
        return first

    def _on_monitored_line(self, code: CodeType, line: int) -> Any:
        # since Python 3.14, a function of its own evaluates annotations, but only when somebody asks for them
        in_tree = code.co_filename.startswith(self._tree) and code.co_name != "__annotate__"
        if in_tree and self._note_line(code.co_filename, line):
            _monitoring.restart_events()
        return _monitoring.DISABLE

    def _on_traced_call(self, frame: FrameType, event: str, what: Any) -> Any:
        return self._on_traced_line if frame.f_code.co_filename.startswith(self._tree) else None

    def _on_traced_line(self, frame: FrameType, event: str, what: Any) -> Any:
        if event == "line":
            self._note_line(frame.f_code.co_filename, frame.f_lineno)
        return self._on_traced_line
