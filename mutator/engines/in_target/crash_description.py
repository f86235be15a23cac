"""What a fork reports of a crash, so that the harness can judge it. Standard library only.

A fork has the mutant's code only in the functions that the mutant changes. So the lines of other frames are
those of the pristine file, and each frame says which code it ran.
"""

from collections.abc import Iterable, Sequence
from types import CodeType
from typing import Any

# what they say, or when they occur, depends on the process: its stack, memory, files and loaded modules
_CLASSES_OF_PROCESS = (RecursionError, MemoryError, OSError, ImportError, SystemError)
Frames = Sequence[tuple[str, int, int, CodeType]]  # those of `run_once.tree_frames`


def is_independent_of_process(error: BaseException) -> bool:
    """Return whether an exception is the same in every process that runs the same code.

    SystemExit, KeyboardInterrupt and the like are not: they are about the process itself.
    """
    return isinstance(error, Exception) and not isinstance(error, _CLASSES_OF_PROCESS)


def describe_crash(
    errors: Sequence[BaseException], frames_by_error: Sequence[Frames], new_codes: Iterable[CodeType]
) -> dict[str, Any] | None:
    """Return the names of the classes of an exception, its causes and those that it groups, and for each its
    frames: file, line, column, and whether its code is one of `new_codes`. None if one depends on the
    process.
    """
    if not all(map(is_independent_of_process, errors)):
        return None
    new_ids = ids_with_inner_functions(new_codes)
    return {
        "classes": [f"{type(error).__module__}.{type(error).__qualname__}" for error in errors],
        "frames": [[(*place, id(code) in new_ids) for *place, code in frames] for frames in frames_by_error],
    }


def ids_with_inner_functions(codes: Iterable[CodeType]) -> set[int]:
    """Return the ids, because code objects that differ only in their file are equal."""
    todo, ids = list(codes), set()
    while todo:
        code = todo.pop()
        ids.add(id(code))
        todo += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return ids
