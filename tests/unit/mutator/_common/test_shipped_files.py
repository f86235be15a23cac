"""The files that ship with the harness: folders of a clone, or an archive that is unpacked."""

from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest

from mutator._common import shipped_files
from mutator._common.shipped_files import check_not_shipped, shipped_folder, write_new_library
from mutator.errors import MutatorError
from mutator.faults.spec_expansion import expand_spec
from mutator.mutants.mutant_building import build
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[4]
FILES = {"target/selfdrive/a.py": b"A = 1\n", "fault_library/b.yaml": b"b: 1\n", "templates/c.j2": b"c\n"}


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "shipped.zip"
    with ZipFile(path, "w") as file:
        for name, data in FILES.items():
            file.writestr(name, data)
    monkeypatch.setattr(shipped_files, "SHIPPED_ARCHIVE_PATH", path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return path


def as_in_a_new_process() -> Path:
    shipped_files._checked_unpacked_folder.cache_clear()
    return shipped_folder()


def test_without_an_archive_the_folders_of_the_clone_are_used() -> None:
    assert shipped_folder() == CLONE


def test_the_archive_is_unpacked_once(archive: Path, tmp_path: Path) -> None:
    folder = shipped_folder()
    assert folder.is_relative_to(tmp_path / "data" / "mutator")
    found = {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    assert found == FILES
    before = (folder / "templates/c.j2").stat()
    assert as_in_a_new_process() == folder
    after = (folder / "templates/c.j2").stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert [p.name for p in folder.parent.iterdir()] == [folder.name]


def test_a_different_archive_is_unpacked_into_a_different_folder(archive: Path) -> None:
    folder = shipped_folder()
    with ZipFile(archive, "a") as file:
        file.writestr("target/selfdrive/new.py", b"")
    assert as_in_a_new_process() != folder
    assert (folder / "target/selfdrive/a.py").exists()


def edit(folder: Path) -> None:
    (folder / "target/selfdrive/a.py").write_bytes(b"A = 2\n")  # same size


def add(folder: Path) -> None:
    (folder / "target/selfdrive/extra.py").touch()


def delete(folder: Path) -> None:
    (folder / "templates/c.j2").unlink()


@pytest.mark.parametrize(
    ("change", "named"), [(edit, "selfdrive/a.py"), (add, "selfdrive/extra.py"), (delete, "templates/c.j2")]
)
def test_a_changed_copy_is_refused(archive: Path, change: Callable[[Path], None], named: str) -> None:
    change(shipped_folder())
    with pytest.raises(
        MutatorError, match=rf"changed since installation: .*{named}.*delete this folder.*mutator init"
    ):
        as_in_a_new_process()


def test_bytecode_is_not_a_change(archive: Path) -> None:
    folder = shipped_folder()
    (folder / "target/selfdrive/__pycache__").mkdir()
    (folder / "target/selfdrive/__pycache__/a.cpython-311.pyc").touch()
    assert as_in_a_new_process() == folder


def test_an_unusable_data_folder_is_an_error_with_a_remedy(
    archive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "file"))
    with pytest.raises(MutatorError, match=r"file/mutator/shipped.*cannot unpack.*set XDG_DATA_HOME"):
        shipped_folder()


def test_a_folder_unpacked_by_another_process_is_used(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = shipped_folder()
    monkeypatch.setattr(Path, "is_dir", lambda path, **_: path.exists() and not _first(seen, path))
    seen: set[Path] = set()
    assert as_in_a_new_process() == folder
    assert folder in seen
    assert [p.name for p in folder.parent.iterdir()] == [folder.name]


def _first(seen: set[Path], path: Path) -> bool:
    """Return whether a path is checked for the first time."""
    new = path not in seen
    seen.add(path)
    return new


def test_writing_to_the_shipped_library_is_refused(archive: Path, tmp_path: Path) -> None:
    check_not_shipped(tmp_path / "library" / "reviews" / "openpilot.yaml")
    with pytest.raises(MutatorError, match=r"ships with mutator.*mutator init DIR"):
        check_not_shipped(shipped_folder() / "fault_library" / "reviews" / "openpilot.yaml")


def test_a_moved_copy_of_the_library_still_finds_the_controller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_new_library(tmp_path / "new")
    (tmp_path / "deep").mkdir()
    moved = (tmp_path / "new").rename(tmp_path / "deep" / "moved")
    for name in ("fault_library", "templates"):
        for path in (CLONE / name).rglob("*.*"):
            copy = moved / path.relative_to(CLONE)
            if path.parent.name != "targets":
                assert copy.read_bytes() == path.read_bytes()
    monkeypatch.chdir(moved / "fault_library")
    found, ours = Workspace.find(), Workspace.find(CLONE)
    assert (found.library, found.templates) == (moved / "fault_library", moved / "templates")
    manifest = found.manifest("openpilot")
    assert (manifest.root, manifest.tree.digest) == (CLONE / "target", ours.manifest("openpilot").tree.digest)
    assert manifest.path.read_text().splitlines()[3] == "root: shipped:target"


def test_edits_in_a_new_library_take_effect(tmp_path: Path) -> None:
    write_new_library(tmp_path / "new")
    template = tmp_path / "new/templates/offset.py.j2"
    template.write_text(template.read_text().replace("{{ by | signed }}", "{{ by | signed }} * 1.0", 1))
    spec = tmp_path / "new/fault_library/faults/radar/chaff.yaml"
    spec.write_text(spec.read_text().replace("after_assign: d_rel", "after_assign: v_rel"))
    workspace = Workspace.find(tmp_path / "new")
    manifest, models = workspace.manifest("openpilot"), workspace.fault_models()
    fault = expand_spec(workspace.spec("radar/chaff"), 0, "as_described", models=models, manifest=manifest)[0]
    patch = build(manifest, models, fault, always_trigger(armed_after_s=1.5)).patch
    assert f"v_rel = v_rel + {fault.value} * 1.0" in patch


@pytest.mark.parametrize("kind", ["file", "full", "below a file"])
def test_a_new_library_needs_an_empty_folder(tmp_path: Path, kind: str) -> None:
    place = tmp_path / "place"
    if kind == "full":
        place.mkdir()
        (place / "thesis.tex").write_text("mine")
    else:
        place.write_text("mine")
    with pytest.raises(MutatorError, match="expected a new or empty folder"):
        write_new_library(place / "below" if kind == "below a file" else place)
    assert [p.read_text() for p in (tmp_path.rglob("*")) if p.is_file()] == ["mine"]
