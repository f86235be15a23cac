"""An import writes a new library with all that the importer returns, or nothing."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.extension_doors import LIBRARY_IMPORTER_DOOR
from mutator.errors import BadAddition, MutatorError
from mutator.onboarding.library_import import (
    EntryOutcome,
    ImportedEntry,
    ImportedLibrary,
    LibraryImporter,
    import_into_new_library,
)
from mutator.stpa.hazard_analysis_checks import list_analysis_problems
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[4]
FILES = ROOT / "tests" / "fixtures" / "uva"


def test_the_imported_faults_belong_to_a_causal_factor(tmp_path: Path) -> None:
    """The hazard analysis of the new library has no gap."""
    import_into_new_library("uva", FILES, tmp_path / "out")
    library = Workspace.find(root=tmp_path / "out")
    analysis = library.analysis()
    assert analysis is not None
    assert [
        str(e) for e in list_analysis_problems(analysis, library.specs(), library.manifest("openpilot"))
    ] == []
    assert analysis.factors_by_id["imported"].faults == [
        "radar/uva_1",
        "radar/uva_6",
        "vision_input/uva_52",
        "vision_output/uva_15",
    ]


def test_the_table_has_a_row_for_each_entry(tmp_path: Path) -> None:
    imported = import_into_new_library("uva", FILES, tmp_path / "out")
    with (tmp_path / "out" / "imported.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(imported.entries) == 11
    assert [row["outcome"] for row in rows].count("refused") == imported.count(EntryOutcome.REFUSED) == 1
    assert rows[0]["campaign"] == "uva_hwt_from_0_and_hwt_to_1_5"


def test_a_package_can_add_an_importer(tmp_path: Path, door_examples: Path) -> None:
    (tmp_path / "drives.txt").write_text("slow 30\nfaster than light\n")
    imported = import_into_new_library("drives", tmp_path, tmp_path / "out")
    assert [entry.outcome.value for entry in imported.entries] == ["imported", "refused"]
    assert "D_slow" in Workspace.find(root=tmp_path / "out").scenarios


def importer(monkeypatch: pytest.MonkeyPatch, library: ImportedLibrary | Exception) -> None:
    def read(folder: Path) -> ImportedLibrary:
        if isinstance(library, Exception):
            raise library
        return library

    monkeypatch.setattr(
        type(LIBRARY_IMPORTER_DOOR), "load", lambda door, name: LibraryImporter(about="a test", read=read)
    )


REFUSED = ImportedEntry(file="a.txt", line=7, outcome=EntryOutcome.REFUSED, reason="too old")
GOOD = ImportedEntry(file="a.txt", line=1, outcome=EntryOutcome.IMPORTED, name="x")


def test_nothing_is_written_if_nothing_can_be_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    importer(monkeypatch, ImportedLibrary(entries=(REFUSED,), texts={}, ignored={}))
    with pytest.raises(MutatorError, match=r"a\.txt:7: nothing can be imported: too old"):
        import_into_new_library("x", tmp_path, tmp_path / "out")
    importer(monkeypatch, ImportedLibrary(entries=(), texts={}, ignored={}))
    with pytest.raises(MutatorError, match="nothing to import"):
        import_into_new_library("x", tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_importer_cannot_write_outside_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    importer(monkeypatch, ImportedLibrary(entries=(GOOD,), texts={"../../evil.yaml": "x"}, ignored={}))
    with pytest.raises(MutatorError, match="evil"):
        import_into_new_library("x", tmp_path, tmp_path / "out")
    assert not list(tmp_path.rglob("evil.yaml"))


@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize(
    ("texts", "said"),
    [
        ({"faults/radar/new.yaml": "a: &x 1\nb: *x\n"}, "anchor"),
        ({"faults/radar/new.yaml": "schema: fault_spec/1\n"}, "new.yaml"),
        ({"faults/radar/chaff.yaml": ""}, r"faults/radar/chaff.yaml: a file of the library that ships"),
    ],
)
def test_nothing_is_left_of_a_library_that_cannot_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exists: bool, texts: dict[str, str], said: str
) -> None:
    importer(monkeypatch, ImportedLibrary(entries=(GOOD,), texts=texts, ignored={}))
    out = tmp_path / "new" / "out"
    if exists:
        out.mkdir(parents=True)
    with pytest.raises(MutatorError, match=said):
        import_into_new_library("x", tmp_path, out)
    assert not (list(out.iterdir()) if exists else out.parent.exists())


def test_the_table_has_no_control_characters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that shows it would act on them."""
    refused = replace(REFUSED, reason="bad \x1b[31m \u2028 word")
    importer(monkeypatch, ImportedLibrary(entries=(GOOD, refused), texts={}, ignored={}))
    import_into_new_library("x", tmp_path, tmp_path / "out")
    text = (tmp_path / "out" / "imported.csv").read_text()
    assert r"bad \x1b[31m \u2028 word" in text and len(text.splitlines()) == 3


def test_an_unknown_format_names_those_that_exist(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match=r"no library importer 'uav'.*did you mean 'uva'"):
        import_into_new_library("uav", FILES, tmp_path / "out")


def test_a_failing_importer_of_a_package_is_blamed(tmp_path: Path, door_examples: Path) -> None:
    """The package is named, not the harness."""
    (tmp_path / "drives.txt").write_text("slow 30\n")
    module = __import__("door_examples.drives", fromlist=["drives"])
    module.SCENARIO, scenario = "{missing}", module.SCENARIO
    try:
        with pytest.raises(BadAddition, match=r"'drives' of package door-examples 1\.0 fails"):
            import_into_new_library("drives", tmp_path, tmp_path / "out")
    finally:
        module.SCENARIO = scenario
