"""Compiled helpers are found by the digest of the code that they replace, and compute the same bytes."""

import shutil
import sys
from pathlib import Path

import pytest
from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import compile_helpers
from selfdrive.sim.run import main
from selfdrive.visiond import compiled_windows
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector
from selfdrive.visiond.compiled_authors_code import CompiledAuthorsCodeDetector, build_authors_code_detector
from selfdrive.visiond.compiled_windows import C_SOURCE

ROOT = Path(__file__).resolve().parents[4]
SCENARIO = ROOT / "fault_library/scenarios/S1.yaml"
COMPILER = compile_helpers.compiler_command()
MODEL = CameraModel()
NAME = compiled.file_name(C_SOURCE)

needs_compiler = pytest.mark.skipif(not COMPILER, reason="there is no C compiler")


@pytest.fixture(autouse=True)
def _none_afterwards():
    """Hide the helpers compiled here from all other tests."""
    yield
    compiled.use_libraries_in(None)


@pytest.fixture
def helpers(all_compiled, tmp_path):
    return shutil.copytree(all_compiled, tmp_path / "own")


def test_every_c_file_names_the_python_files_that_it_replaces():
    sources = list(compile_helpers.PACKAGE_FOLDER.rglob("*.c"))
    assert C_SOURCE in sources
    for source in sources:
        named = compiled.stands_for(source.read_bytes())
        assert named and all((source.parent / name).is_file() for name in named)


@needs_compiler
@pytest.mark.parametrize("edited", ["mark_windows.c", "hog.py", "lane_net.py"])
def test_a_library_is_found_only_for_the_code_that_it_replaces(helpers, monkeypatch, tmp_path, edited):
    compiled.use_libraries_in(helpers)
    assert compiled.library(C_SOURCE) is not None
    for name in (C_SOURCE.name, *compiled.stands_for(C_SOURCE.read_bytes())):
        shutil.copy(C_SOURCE.with_name(name), tmp_path)
    monkeypatch.setattr(compiled_windows, "C_SOURCE", tmp_path / C_SOURCE.name)
    assert type(build_authors_code_detector(MODEL)) is CompiledAuthorsCodeDetector
    (tmp_path / edited).write_text((tmp_path / edited).read_text() + "\n")
    assert type(build_authors_code_detector(MODEL)) is AuthorsCodeDetector
    compiled.use_libraries_in(None)
    assert compiled.library(C_SOURCE) is None


@needs_compiler
@pytest.mark.parametrize("keep", [0, 10, 5000, -1])
def test_a_truncated_library_is_not_used(helpers, keep):
    (helpers / NAME).write_bytes((helpers / NAME).read_bytes()[:keep])
    compiled.use_libraries_in(helpers)
    assert compiled.library(C_SOURCE) is None
    assert type(build_authors_code_detector(MODEL)) is AuthorsCodeDetector


@needs_compiler
def test_a_library_with_a_changed_byte_is_not_used(helpers):
    """Nothing else would reveal a changed constant."""
    data = bytearray((helpers / NAME).read_bytes())
    data[len(data) // 2] ^= 1
    (helpers / NAME).write_bytes(data)
    compiled.use_libraries_in(helpers)
    assert type(build_authors_code_detector(MODEL)) is AuthorsCodeDetector


@pytest.mark.parametrize("folder", ["none", "x" * 300, "empty"])
def test_a_folder_without_libraries_is_not_an_error(tmp_path, folder):
    (tmp_path / "empty").mkdir()
    compiled.use_libraries_in(tmp_path / folder)
    assert compiled.library(C_SOURCE) is None


@needs_compiler
@pytest.mark.slow
def test_compiling_again_gives_the_same_bytes_and_deletes_old_libraries(all_compiled, tmp_path):
    old = tmp_path / f"warp-0{compiled.SUFFIX}"
    old.touch()
    list(compile_helpers.compile_helpers(tmp_path))
    assert {f.name: f.read_bytes() for f in tmp_path.iterdir()} == {
        f.name: f.read_bytes() for f in all_compiled.iterdir()
    }


@pytest.mark.parametrize("given", ["no-such-compiler", "/", "cc '"])
def test_without_a_compiler_the_command_exits_with_code_2(tmp_path, monkeypatch, capsys, given):
    monkeypatch.setenv("CC", given)
    monkeypatch.setattr("sys.argv", ["compile_helpers", "--out", str(tmp_path)])
    assert compile_helpers.main() == 2
    said = capsys.readouterr().err
    assert f"CC is {given!r}: " in said and "; install one or set CC; without one" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("there", [True, False], ids=["ziglang", "nothing"])
def test_without_cc_the_compiler_of_ziglang_is_used(monkeypatch, there):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(compile_helpers, "find_spec", lambda name: there or None)
    assert compile_helpers.compiler_command()[:3] == [sys.executable, "-m", "ziglang"] * there


@needs_compiler
@pytest.mark.slow
def test_runs_have_the_same_bytes_with_and_without_helpers(all_compiled, tmp_path, monkeypatch):
    found = []
    look = compiled.library

    def noted(source):
        library = look(source)
        found.extend([library] if library else [])
        return library

    monkeypatch.setattr(compiled, "library", noted)

    def drive(name, *more):
        out = tmp_path / name
        words = ["--scenario", str(SCENARIO), "--out", str(out), "--pictures", "--max-steps", "800"]
        assert main([*words, *more]) == 0
        return [(out / file).read_bytes() for file in ("record.json", "trace.npz")]

    with_helpers = drive("with", "--compiled", str(all_compiled))
    used = len(found)
    assert used
    assert drive("forget", "--forget", "--compiled", str(all_compiled)) == with_helpers and len(found) == used
    assert drive("without") == with_helpers and len(found) == used
