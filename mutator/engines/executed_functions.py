"""What a run executed of its tree, as the process of the run notes it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class ExecutedFunctions:
    """The functions of a tree that a run executed.

    * `names_by_file`: qualified names, without functions inside of functions; with module and class bodies
    * `files_read`: Python files of the tree that the run read as text
    * `obstacle`: why this cannot be all that ran; empty if it is
    """

    names_by_file: Mapping[str, tuple[str, ...]]
    files_read: tuple[str, ...] = ()
    obstacle: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return what `executed_functions_from_json` reads."""
        return {
            "functions": {file: list(names) for file, names in self.names_by_file.items()},
            "read": list(self.files_read),
            "obstacle": self.obstacle,
        }


def executed_functions_from_json(data: object) -> ExecutedFunctions | None:
    """Return what a process noted; None if it noted nothing, or if a run has overwritten it."""
    try:
        functions, read, obstacle = (data[name] for name in ("functions", "read", "obstacle"))  # type: ignore[index]
        executed = ExecutedFunctions(
            names_by_file={file: tuple(names) for file, names in functions.items()},
            files_read=tuple(read),
            obstacle=obstacle,
        )
        texts = (*executed.names_by_file, *executed.files_read, executed.obstacle)
        names = (name for names in executed.names_by_file.values() for name in names)
        return executed if all(isinstance(text, str) for text in (*texts, *names)) else None
    except (LookupError, TypeError, AttributeError):
        return None
