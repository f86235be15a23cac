"""Compiled helpers: found by what they were made of, the same bytes, never in the way."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError
from selfdrive.controls.lib.lateral_mpc import lateral_ocp
from selfdrive.controls.lib.long_mpc import long_ocp
from selfdrive.controls.lib.mpc_solver import condense, integrators_of
from selfdrive.sim import compile_helpers
from selfdrive.sim.run import main
from selfdrive.visiond import compiled_hog, hog
from selfdrive.visiond.compiled_hog import C_SOURCE, CompiledHog, build_hog, made_of
from selfdrive.visiond.hog import Hog

ROOT = Path(__file__).resolve().parents[4]
SCENARIO = ROOT / "fault_library/scenarios/S1.yaml"
COMPILER = compile_helpers.compiler()
SIZE = 112, 480

needs_compiler = pytest.mark.skipif(shutil.which(COMPILER[0]) is None, reason="there is no C compiler")


@pytest.fixture(autouse=True)
def _none_afterwards():
    """No other test finds the helpers of this one."""
    yield
    compiled.use(None)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A cache folder with a library of hog.c."""
    cache = tmp_path_factory.mktemp("cache")
    compile_helpers.make(cache, "hog", made_of(), C_SOURCE.read_text(), lambda library: True)
    return cache


@pytest.fixture
def hog_in(made, tmp_path):
    """The same, a copy of the test's own."""
    return shutil.copytree(made, tmp_path / "own")


def pictures(rows, width):
    """Noise, an even grey, black and white stripes one pixel wide, a slope."""
    row, column = np.mgrid[:rows, :width]
    noise = np.random.default_rng(5).integers(0, 256, (rows, width))
    every = noise, np.full_like(row, 93), 255 * (column % 2), (3 * row + 5 * column) % 256
    return [picture.astype(np.uint8) for picture in every]


@needs_compiler
@pytest.mark.parametrize("size", [(32, 32), SIZE, (48, 100)])
def test_compiled_gradients_have_the_same_bytes(hog_in, size):
    """Blocks of any picture, its border among it, are those of the Python code to the last bit."""
    compiled.use(hog_in)
    plain, fast = Hog(*size), build_hog(*size)
    assert isinstance(fast, CompiledHog) and fast.calculated_by != plain.calculated_by
    for picture in pictures(*size):
        for one in (picture, np.asfortranarray(picture), picture * np.float32(0.7)):
            assert fast.blocks(one).tobytes() == plain.blocks(one).tobytes()


@needs_compiler
def test_a_picture_of_another_size_is_an_error_as_without(hog_in):
    """C code would read beyond its end."""
    compiled.use(hog_in)
    for each in (build_hog(*SIZE), Hog(*SIZE)):
        with pytest.raises(ValueError, match="broadcast"):
            each.blocks(np.zeros((32, 32), np.uint8))


@needs_compiler
def test_a_library_is_found_only_for_what_it_was_made_of(hog_in, monkeypatch, tmp_path):
    """Of other Python or C code, of another name, or while none is to be used: none."""
    compiled.use(hog_in)
    found = compiled.library("hog", made_of)
    assert found is not None and found.path.parent == hog_in / compiled.FOLDER
    assert compiled.library("long_mpc", made_of) is None
    for module, name in ((compiled_hog, "C_SOURCE"), (hog, "__file__")):
        edited = tmp_path / "hog"
        edited.write_bytes(Path(getattr(module, name)).read_bytes() + b"\n")
        with monkeypatch.context() as patch:
            patch.setattr(module, name, edited)
            assert type(build_hog(*SIZE)) is Hog
    compiled.use(None)
    assert compiled.library("hog", made_of) is None


@needs_compiler
@pytest.mark.parametrize("keep", [0, 10, 5000, -1])
def test_a_library_that_is_damaged_is_none(hog_in, keep):
    """The Python code calculates, as if nobody had compiled anything."""
    (path,) = (hog_in / compiled.FOLDER).iterdir()
    path.write_bytes(path.read_bytes()[:keep])
    compiled.use(hog_in)
    asked = []
    assert compiled.library("hog", lambda: asked.append(1) or made_of()) is None and asked
    assert type(build_hog(*SIZE)) is Hog


@needs_compiler
def test_a_changed_constant_of_a_library_is_noticed(hog_in):
    """It would calculate other numbers, and nothing else would tell."""
    (path,) = (hog_in / compiled.FOLDER).iterdir()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    compiled.use(hog_in)
    assert type(build_hog(*SIZE)) is Hog


@pytest.mark.parametrize("cache", ["none", "x" * 300, "empty"])
def test_a_cache_without_libraries_is_no_error(tmp_path, cache):
    """One that is not there, that cannot be looked into, or that a failed attempt left."""
    (tmp_path / "empty" / compiled.FOLDER).mkdir(parents=True)
    compiled.use(tmp_path / cache)
    assert compiled.library("hog", pytest.fail) is None


@pytest.mark.parametrize("given", ["no-such-compiler", "/", "cc '"])
def test_without_a_compiler_it_says_so_and_leaves_nothing(tmp_path, monkeypatch, capsys, given):
    """The message has what CC is, what was expected and the remedy; exit code 2."""
    monkeypatch.setenv("CC", given)
    monkeypatch.setattr("sys.argv", ["compile_helpers", "--cache", str(tmp_path)])
    assert compile_helpers.main() == 2
    said = capsys.readouterr().err
    assert f"CC is {given!r}: " in said and "; install one or set CC, or go on" in said
    assert list((tmp_path / compiled.FOLDER).iterdir()) == []


@needs_compiler
def test_a_compiler_that_calculates_otherwise_is_found_out(tmp_path, monkeypatch):
    """What gives other numbers than the code it stands for is not kept."""
    wrong, right = tmp_path / "wrong-cc", " ".join(COMPILER)
    wrong.write_text(f'#!/bin/sh\nsed -i "s/pair.k. . by/by/" "$1" && exec {right} "$@"\n')
    wrong.chmod(0o755)
    monkeypatch.setenv("CC", str(wrong))
    with pytest.raises(ConfigError, match="compiled, hog gives other numbers"):
        list(compile_helpers.compile_helpers(tmp_path))
    assert list((tmp_path / compiled.FOLDER).iterdir()) == []


@pytest.mark.parametrize("ocp", [long_ocp(), lateral_ocp(0.5)], ids=lambda ocp: ocp.name)
def test_the_trials_of_the_controllers_are_numbers(ocp):
    """Where nothing but NaN comes out, any code is exact."""
    found = compile_helpers.outputs(condense(ocp, integrators_of(ocp)))
    assert all(np.isfinite(np.frombuffer(output)).all() for output in found)


@needs_compiler
@pytest.mark.slow
def test_runs_have_the_same_bytes_and_the_proof_takes_no_helper(tmp_path, monkeypatch):
    """Record and trace of a run with pictures are the same with and without helpers; with `--forget` none is
    found."""
    cache = tmp_path / "cache"
    assert len(list(compile_helpers.compile_helpers(cache))) == 3
    found = []
    look = compiled.library

    def noted(name, made_of):
        library = look(name, made_of)
        found.extend([library] if library else [])
        return library

    monkeypatch.setattr(compiled, "library", noted)

    def drive(name, *more):
        out = tmp_path / name
        words = ["--scenario", str(SCENARIO), "--out", str(out), "--pictures", "--max-steps", "800"]
        assert main([*words, "--cache", str(cache), *more]) == 0
        return [(out / file).read_bytes() for file in ("record.json", "trace.npz")]

    with_helpers = drive("with")
    assert len(found) == 3
    assert drive("forget", "--forget") == with_helpers and len(found) == 3
    shutil.rmtree(cache / compiled.FOLDER)
    assert drive("without") == with_helpers and len(found) == 3
