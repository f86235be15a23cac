"""Import fault files of others into a new library. An importer knows their format and where they belong."""

import csv
import io
import tempfile
from collections.abc import Callable, Mapping, Set
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from textwrap import indent

from mutator._common.confined_files import path_below, write_below
from mutator._common.extension_doors import LIBRARY_IMPORTER_DOOR
from mutator._common.shipped_files import make_empty_folder, write_new_library
from mutator.config.yaml_writing import yaml_text
from mutator.errors import MutatorError
from mutator.stpa.hazard_analysis_checks import injection_places
from mutator.workspace import Workspace

REPORT_NAME = "imported.csv"
_SPECS_PREFIX = "faults/"


class EntryOutcome(StrEnum):
    """What became of an entry of an imported file."""

    IMPORTED = "imported"  #: it was added to the new library
    EQUAL = "equal"  #: the library that ships with mutator has the same
    REFUSED = "refused"  #: nothing was imported, for a reason


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedEntry:
    """An entry of an imported file, and what became of it."""

    file: str  #: path below the imported folder
    line: int  #: number of the line, from 1
    outcome: EntryOutcome  #: whether the new library has it
    name: str = ""  #: its name in the library: the variant of a fault, or a scenario; empty if refused
    value: str = ""  #: the fault's value or values, with unit
    campaign: str = ""  #: campaign of the new library that runs it
    reason: str = ""  #: why it was refused


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedLibrary:
    """What an importer makes of a folder."""

    entries: tuple[ImportedEntry, ...]  #: in the order of files and lines
    texts: Mapping[str, str]  #: the texts of new files, by their path in `fault_library/`
    ignored: Mapping[str, str]  #: why files were not read, by their names

    def count(self, outcome: EntryOutcome) -> int:
        """Return the number of entries with this outcome."""
        return sum(entry.outcome is outcome for entry in self.entries)


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryImporter:
    """A format of `mutator import`.

    `read` returns what becomes of the files in a folder: each entry is imported, equal to a fault that ships
    with mutator, or refused with a reason. The files are data from anybody: `read` parses them and executes
    nothing. MutatorError, with file and line, for files that are not in the format. The texts are added to a
    copy of the library that ships with mutator.

    `mapping` is a table for the reference page: what an entry names, what it becomes, and what differs.
    """

    about: str
    read: Callable[[Path], ImportedLibrary]
    mapping: tuple[tuple[str, str, str], ...] = ()


def import_into_new_library(format_name: str, source: Path, folder: Path) -> ImportedLibrary:
    """Write a library with the faults in `source` into a new or empty `folder`, and `imported.csv`, which has
    a row for each entry.

    MutatorError for an unknown format, for files that are not in it, if nothing can be imported, for a folder
    that is not empty, and for specs that cannot be read back. `folder` then stays as it was.
    """
    importer = LIBRARY_IMPORTER_DOOR.load(format_name)
    with LIBRARY_IMPORTER_DOOR.blaming_package(format_name):
        imported: ImportedLibrary = importer.read(source)
    _check_not_empty(imported, source)
    missing = [path for path in (folder.absolute(), *folder.absolute().parents) if not path.exists()]
    make_empty_folder(folder)
    try:
        with tempfile.TemporaryDirectory(prefix=".import.", dir=folder) as scratch:
            whole = Path(scratch) / "library"
            _write_library(imported, whole)
            for path in whole.iterdir():
                path.rename(path_below(folder, path.name))
    except BaseException:
        for path in missing:
            with suppress(OSError):
                path.rmdir()
        raise
    return imported


def _write_library(imported: ImportedLibrary, folder: Path) -> None:
    write_new_library(folder)
    library = folder / "fault_library"
    for name, text in imported.texts.items():
        if path_below(library, name).exists():
            raise MutatorError(
                "a file of the library that ships with mutator",
                where=name,
                expected="a new name for each file that an importer adds",
                remedy="correct the importer",
            )
        write_below(library, name, text.encode())
    _add_causal_factor(folder, {name for name in imported.texts if name.startswith(_SPECS_PREFIX)})
    (folder / REPORT_NAME).write_text(_report_text(imported), encoding="utf-8")


def _check_not_empty(imported: ImportedLibrary, source: Path) -> None:
    refused = [entry for entry in imported.entries if entry.outcome is EntryOutcome.REFUSED]
    if len(refused) < len(imported.entries):
        return
    first = refused[0] if refused else None
    raise MutatorError(
        f"nothing can be imported: {first.reason}" if first else "nothing to import",
        where=f"{source}/{first.file}" if first else source,
        line=first.line if first else None,
        expected="at least one fault for which there is a place in the target",
    )


def _add_causal_factor(folder: Path, spec_names: Set[str]) -> None:
    """Add the imported faults to the hazard analysis as a causal factor that can lead to every unsafe action,
    because the files of others do not say to which.
    """
    workspace = Workspace.find(root=folder)
    analysis = workspace.analysis()
    specs = [
        spec
        for spec in workspace.specs()
        if spec.path.relative_to(workspace.library).as_posix() in spec_names
    ]
    if analysis is None or not specs:
        return
    manifest = workspace.manifest(workspace.target_name())
    places = sorted({place for spec in specs for place in injection_places(spec, manifest)})
    paths = {place.partition("::")[0] for place in places}
    components = [
        name for name, component in analysis.structure.components.items() if paths & {*component.modules}
    ]
    factor = {
        "about": "Faults that were imported.",
        "where": components or list(analysis.structure.components),
        "at": places,
        "leads_to": list(analysis.unsafe_actions),
        "faults": sorted(spec.name for spec in specs),
    }
    text = indent(yaml_text({"imported": factor}), "  ")
    with analysis.factors_source.path.open("a", encoding="utf-8") as file:
        file.write(text)


def _report_text(imported: ImportedLibrary) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(ImportedEntry.__slots__)
    writer.writerows(
        [_printable_text(str(getattr(entry, name))) for name in ImportedEntry.__slots__]
        for entry in imported.entries
    )
    return text.getvalue()


def _printable_text(text: str) -> str:
    """Return the text with escapes for characters that a terminal or a table program would act on."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
