"""Note the types of variables when lines of a tree begin, from the first observation on.

Standard library only.
"""

import importlib.util
import sys
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

_spec = importlib.util.spec_from_file_location("line_recorder", Path(__file__).with_name("line_recorder.py"))
assert _spec and _spec.loader
line_recorder: Any = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(line_recorder)

_MOST_VISITS = 20  # of a line: later ones seldom bring new types, and looking takes time
_Place = tuple[str, int]  # file and line, from 1


class TypeRecorder(line_recorder.LineRecorder):  # type: ignore[misc]  # loaded from a file
    """A LineRecorder that also notes the types of local variables when a line begins."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._visits: dict[_Place, int] = {}
        self._types: dict[_Place, dict[str, set[str]]] = {}

    def collect_types(self) -> dict[str, dict[str, dict[str, str]]]:
        """Return the types by file, line and name, of names that were bound whenever the line began."""
        files: dict[str, dict[str, dict[str, str]]] = {}
        for (file, line), types in sorted(self._types.items() if self._has_begun else ()):
            names = {name: " or ".join(sorted(kinds)) for name, kinds in sorted(types.items())}
            if names:
                files.setdefault(file.removeprefix(self._tree), {})[str(line)] = names
        return files

    def _note_types(self, frame: FrameType, line: int) -> bool:
        """Note the types of a frame's variables; return whether the line needs no more visits."""
        place = (frame.f_code.co_filename, line)
        visits = self._visits[place] = self._visits.get(place, 0) + 1
        if visits > _MOST_VISITS:
            return True
        types = {name: _type_name(value) for name, value in frame.f_locals.items() if name.isidentifier()}
        if visits == 1:
            self._types[place] = {name: {kind} for name, kind in types.items()}
        else:
            earlier = self._types[place]
            self._types[place] = {n: kinds | {types[n]} for n, kinds in earlier.items() if n in types}
        return False

    def _note_line(self, file: str, line: int) -> bool:
        is_first: bool = super()._note_line(file, line)
        if is_first:
            self._visits.clear()
            self._types.clear()
        return is_first

    def _on_monitored_line(self, code: CodeType, line: int) -> Any:
        disable = super()._on_monitored_line(code, line)
        if not code.co_filename.startswith(self._tree):
            return disable
        return disable if self._note_types(sys._getframe(1), line) else None

    def _on_traced_line(self, frame: FrameType, event: str, what: Any) -> Any:
        if event == "line":
            self._note_line(frame.f_code.co_filename, frame.f_lineno)
            self._note_types(frame, frame.f_lineno)
        return self._on_traced_line


def _type_name(value: object) -> str:
    """Return the name of a value's type; of numpy arrays, also element type and shape."""
    kind = type(value)
    name = f"{kind.__module__}.{kind.__qualname__}"
    if name == "numpy.ndarray":
        name += f" {value.dtype} {value.shape}"  # type: ignore[attr-defined]
    return name
