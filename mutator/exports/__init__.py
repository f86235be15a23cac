"""Write runs for other tools: mutation testing viewers, code scanning, CI servers, spreadsheets, data frames.

A format is an `Export`: in a module of `formats/`, or from another package (entry points of the group
`mutator.exports`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import EnumType, StrEnum
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.extension_doors import EXPORT_DOOR
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.store.run_folder import RunFolder
    from mutator.workspace import Workspace


class _FormatMembers(EnumType):
    if TYPE_CHECKING:  # members come from the folder of formats

        def __getattr__(cls, name: str) -> "Format": ...


class Format(StrEnum, metaclass=_FormatMembers):
    """The formats that a run can be written in. Other packages can add more, which have names only."""

    _ignore_ = "name"
    for name in EXPORT_DOOR.shipped_names():
        vars()[name.replace("-", "_").upper()] = name

    @property
    def about(self) -> str:
        """What the format is."""
        return find_export(self).about


class ExportTable(StrEnum):
    """The tables that can be exported."""

    RESULTS = "results"
    PROPAGATION = "propagation"
    TIMINGS = "timings"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportSelection:
    """The part of a run to write: the outcomes that are reported as failures, a filter over the columns of
    the results, the table, and an earlier run folder whose hazards are left out.
    """

    failures: Sequence[str] = ()
    only: str | None = None
    table: ExportTable = ExportTable.RESULTS
    base: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportRequest:
    """What to write: a run folder, the file or folder for it, the library with the target if the format needs
    it and there is one, and the part of the run.
    """

    folder: "RunFolder"
    out: Path
    workspace: "Workspace | None"
    selection: ExportSelection


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """A format.

    `write` returns the content of the file, or None if it has written the folder `out` itself. `file` is the
    default name in the run's `exports/`; `{table}` in it is the name of the table. In another package, it is
    the name of the format with a suffix.
    """

    about: str
    file: str
    write: Callable[[ExportRequest], bytes | None]
    options: frozenset[str] = frozenset()  # the fields of `ExportSelection` that it reads
    needs_library: bool = False  # fails without the library and the target
    uses_library: bool = False  # writes more if they are there


def find_export(name: str) -> Export:
    """Return the format of that name; MutatorError if there is none, or if its package is broken."""
    export = EXPORT_DOOR.load(name)
    assert isinstance(export, Export)
    if name not in EXPORT_DOOR.shipped_names() and not fnmatchcase(export.file, f"{name}.?*"):
        raise MutatorError(  # `mutator clean` knows an export by this name
            f"export '{name}' writes the file '{export.file}'",
            expected=f"the name '{name}' with a suffix",
            remedy="correct `file` in the package that adds it",
        )
    return export


def check_options(name: str, export: Export, selection: ExportSelection) -> None:
    """Raise MutatorError for a part of a run that this format cannot write."""
    chosen = {
        "failures": bool(selection.failures),
        "only": selection.only is not None,
        "table": selection.table is not ExportTable.RESULTS,
        "base": selection.base is not None,
    }
    for option, is_chosen in chosen.items():
        if is_chosen and option not in export.options:
            raise MutatorError(f"not valid for {name}", argument=option, remedy=f"leave `{option}` out")
