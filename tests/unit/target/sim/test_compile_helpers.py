"""Compiled helpers: found by what they were made of, the same bytes, never in the way."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError
from selfdrive.sim import compile_helpers
from selfdrive.sim.run import main
from selfdrive.visiond.hog import C_SOURCE, CompiledHog, Hog, build_hog

ROOT = Path(__file__).resolve().parents[4]
SCENARIO = ROOT / "fault_library/scenarios/S1.yaml"
COMPILER = shutil.which(os.environ.get("CC", "cc"))

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="there is no C compiler")


@pytest.fixture(autouse=True)
def _none_afterwards():
    """No other test finds the helpers of this one."""
    yield
    compiled.use(None)


@pytest.fixture
def hog_in(tmp_path):
    """A cache folder with a library of hog.c."""
    made_of = C_SOURCE.read_bytes()
    compiled.make(tmp_path, "hog", made_of, made_of.decode(), lambda path: True)
    return tmp_path


def pictures(rows, width):
    """Noise, an even grey, black and white stripes one pixel wide, a slope."""
    row, column = np.mgrid[:rows, :width]
    noise = np.random.default_rng(5).integers(0, 256, (rows, width))
    every = noise, np.full_like(row, 93), 255 * (column % 2), (3 * row + 5 * column) % 256
    return [picture.astype(np.uint8) for picture in every]


@needs_compiler
@pytest.mark.parametrize("size", [(32, 32), (112, 480), (48, 100)])
def test_compiled_gradients_have_the_same_bytes(hog_in, size):
    """Blocks of any picture, its border among it, are those of the Python code to the last bit."""
    compiled.use(hog_in)
    plain, fast = Hog(*size), build_hog(*size)
    assert isinstance(fast, CompiledHog)
    for picture in pictures(*size):
        assert fast.blocks(picture).tobytes() == plain.blocks(picture).tobytes()


@needs_compiler
def test_a_picture_of_another_size_is_refused(hog_in):
    """C code would read beyond its end."""
    compiled.use(hog_in)
    with pytest.raises(ValueError, match=r"\(32, 32\), expected \(112, 480\)"):
        build_hog(112, 480).blocks(np.zeros((32, 32), np.uint8))


@needs_compiler
def test_a_library_is_found_only_for_what_it_was_made_of(hog_in):
    """Of another source, of another name, of other compiler options, or while none is to be used: none."""
    made_of = C_SOURCE.read_bytes()
    compiled.use(hog_in)
    found = compiled.library("hog", made_of)
    assert found is not None and found.parent == hog_in / compiled.FOLDER
    assert compiled.library("hog", made_of + b" ") is None
    assert compiled.library("long_mpc", made_of) is None
    compiled.use(None)
    assert compiled.library("hog", made_of) is None
    compiled.use(hog_in / "elsewhere")
    assert not compiled.in_use()


def test_a_library_that_cannot_be_loaded_is_none(tmp_path, monkeypatch):
    """The Python code calculates, as if nobody had compiled anything."""
    monkeypatch.setattr(compile_helpers.compiled, "_run", lambda compiler, code, made: made.write_text("?"))
    compiled.make(tmp_path, "hog", C_SOURCE.read_bytes(), "", lambda path: True)
    compiled.use(tmp_path)
    assert compiled.in_use() and type(build_hog(112, 480)) is Hog


def test_without_a_compiler_it_says_so_and_leaves_nothing(tmp_path, monkeypatch, capsys):
    """The message names the compiler, what was expected and the remedy; exit code 2."""
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr("sys.argv", ["compile_helpers", "--cache", str(tmp_path)])
    assert compile_helpers.main() == 2
    said = capsys.readouterr().err
    assert "'no-such-compiler' is not there, expected a C compiler; install one or set CC" in said
    assert list((tmp_path / compiled.FOLDER).iterdir()) == []


@needs_compiler
def test_a_compiler_that_calculates_otherwise_is_found_out(tmp_path, monkeypatch):
    """What gives other numbers than the code it stands for is not kept."""
    wrong = tmp_path / "wrong-cc"
    wrong.write_text(f'#!/bin/sh\nsed -i "s/pair.k. . by/by/" "$1" && exec {COMPILER} "$@"\n')
    wrong.chmod(0o755)
    monkeypatch.setenv("CC", str(wrong))
    with pytest.raises(ConfigError, match="compiled, hog gives other numbers"):
        list(compile_helpers.compile_helpers(tmp_path))
    assert list((tmp_path / compiled.FOLDER).iterdir()) == []


@needs_compiler
@pytest.mark.slow
def test_runs_have_the_same_bytes_and_the_proof_takes_no_helper(tmp_path, monkeypatch):
    """Record and trace of a run with pictures are the same with and without helpers; with `--forget` none is
    looked for."""
    cache = tmp_path / "cache"
    assert len(list(compile_helpers.compile_helpers(cache))) == 3
    asked = []
    look = compiled.library
    monkeypatch.setattr(compiled, "library", lambda name, of: asked.append(look(name, of)) or asked[-1])

    def drive(name, *more):
        out = tmp_path / name
        words = ["--scenario", str(SCENARIO), "--out", str(out), "--pictures", "--max-steps", "800"]
        assert main([*words, "--cache", str(cache), *more]) == 0
        return [(out / file).read_bytes() for file in ("record.json", "trace.npz")]

    with_helpers = drive("with")
    assert len(asked) == 3 and None not in asked
    assert drive("forget", "--forget") == with_helpers and len(asked) == 3
    shutil.rmtree(cache / compiled.FOLDER)
    assert drive("without") == with_helpers and len(asked) == 3
