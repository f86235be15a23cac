"""Effects compiled from C return the same bits as the Python code, for any level, size and region."""

import shutil
import subprocess
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import cv2
import numpy as np
import pytest
from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import compile_helpers, effects
from selfdrive.sim.effects import (
    air,
    compiled_gaussian,
    compiled_precipitation,
    compiled_scattered,
    gaussian,
    particles,
    precipitation,
    scattered,
)
from selfdrive.sim.effects.compiled_gaussian import CompiledGaussian, build_gaussian
from selfdrive.sim.effects.effect import Moment
from selfdrive.sim.effects.gaussian import Gaussian
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.picture import Picture, Region
from selfdrive.sim.picture_camera import PictureCamera
from selfdrive.sim.picture_options import AUTHORS_CODE_DETECTOR, PAPER_DETECTOR, PictureOptions
from selfdrive.sim.run import simulate, write_run
from selfdrive.sim.scenario import load_scenario

SCENARIO = Path(__file__).resolve().parents[4] / "fault_library/scenarios/S1.yaml"
CAMERAS = {
    "usual": CameraModel(),
    "large": CameraModel.from_view(width=1280, rows=720, horizon=238.0, focal=1000.0, height=1.5),
    "odd": replace(CameraModel(), width=321, rows=243, cx=160.0, cy=130.0),
}
COMPILED = (
    effects.CodedFog,
    effects.CodedOcclusion,
    effects.CodedRain,
    effects.CodedSnow,
    effects.GaussianBlur,
    effects.PaperRain,
    effects.Rain,
    effects.Snow,
)
C_SOURCES = (compiled_gaussian.C_SOURCE, compiled_precipitation.C_SOURCE, compiled_scattered.C_SOURCE)

pytestmark = pytest.mark.skipif(not compile_helpers.compiler_command(), reason="there is no C compiler")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return compile_effects(tmp_path_factory.mktemp("compiled"))


def compile_effects(folder, *options):
    for source in C_SOURCES:
        made = folder / compiled.file_name(source)
        words = [
            *compile_helpers.compiler_command(),
            *options,
            source,
            "-o",
            made,
            *compile_helpers.COMPILER_OPTIONS,
        ]
        subprocess.run(words, check=True)
        made.write_bytes(made.read_bytes() + sha256(made.read_bytes()).digest())
    return folder


@pytest.fixture
def both(folder):
    """Build an effect in Python and in C. Skip the test if OpenCV computes different bits from the C code."""

    def made(kind, amount, seed, camera):
        compiled.use_libraries_in(None)
        plain = kind(amount, seed, camera).ready()
        compiled.use_libraries_in(folder)
        fast = kind(amount, seed, camera).ready()
        if fast._key == plain._key:
            pytest.skip("OpenCV computes different bits from the C code")
        return plain, fast

    yield made
    compiled.use_libraries_in(None)


def pictures(random, shape):
    noise = random.integers(0, 256, shape, np.uint8)
    return [
        noise,
        cv2.GaussianBlur(noise, (0, 0), 6.0),
        *(np.full(shape, level, np.uint8) for level in (0, 255)),
    ]


@pytest.mark.parametrize("size", CAMERAS)
@pytest.mark.parametrize("kind", COMPILED)
def test_compiled_effects_have_the_same_bits(both, kind, size):
    camera, random = CAMERAS[size], np.random.default_rng(7)
    amounts = AMOUNTS_BY_EFFECT[kind]
    for seed, amount in enumerate({amounts[0], amounts[len(amounts) // 2], amounts[-1]}):
        plain, fast = both(kind, amount, 123456789 * seed, camera)
        for picture in pictures(random, (camera.rows, camera.width)):
            scene = Moment(*random.uniform((-1.0, 0.0, 0.0), (60.0, 2000.0, 45.0)).tolist())
            seen = plain.apply(picture, scene)
            assert np.array_equal(fast.apply(picture, scene), seen)
            lazy = fast.apply(
                Picture(("any",), picture.shape, lambda region, p=picture: p[region.part]), scene
            )
            top, left = random.integers(0, picture.shape)
            bottom, right = random.integers((top + 1, left + 1), np.add(picture.shape, 1))
            part = Region(top, bottom, left, right).part
            assert np.array_equal(lazy[part], seen[part])


@pytest.mark.parametrize("kind", [effects.CodedOcclusion, effects.PaperRain, effects.Rain])
def test_results_do_not_depend_on_wide_vector_instructions(folder, tmp_path, camera, moment, kind):
    drawn = []
    noise = np.random.default_rng(2).integers(0, 256, (camera.rows, camera.width), np.uint8)
    for libraries in (folder, compile_effects(tmp_path, "-DIS_FAST=0")):
        compiled.use_libraries_in(libraries)
        drawn.append(kind(AMOUNTS_BY_EFFECT[kind][-1], 1, camera))
    compiled.use_libraries_in(None)
    if any(effect._key[-1] == "" for effect in drawn):
        pytest.skip("OpenCV computes different bits from the C code")
    assert drawn[0]._key != drawn[1]._key
    assert np.array_equal(*(effect.apply(noise, moment(3)) for effect in drawn))


@pytest.mark.parametrize("speed", [np.float64(20.0), np.nan, np.inf, -5.0, 1e30])
def test_impossible_speeds_give_the_same_drawing(both, camera, speed):
    """A fault can cause impossible speeds."""
    plain, fast = both(effects.Snow, 10, 1, camera)
    picture = np.full((camera.rows, camera.width), 90, np.uint8)
    scene = Moment(3.0, 77.0, speed)
    with np.errstate(all="ignore"):
        assert np.array_equal(fast.apply(picture, scene), plain.apply(picture, scene))


@pytest.mark.parametrize(("sigma", "size"), [(0.5, 0), (1.2, 0), (5.0, 0), (7.0, 29), (0.0, 3), (0.0, 31)])
def test_compiled_blurs_have_the_same_bits(folder, sigma, size):
    compiled.use_libraries_in(folder)
    fast, plain, random = build_gaussian(sigma, size), Gaussian(sigma, size), np.random.default_rng(3)
    compiled.use_libraries_in(None)
    if not isinstance(fast, CompiledGaussian):
        pytest.skip("OpenCV computes different bits from the C code")
    for shape in [(1, 1), (3, 90), (plain.size // 2 + 1,) * 2, (60, 80), *random.integers(1, 200, (12, 2))]:
        for picture in pictures(random, tuple(shape)):
            assert np.array_equal(fast(picture), plain(picture))
            assert np.array_equal(fast(picture[::-1, ::2]), plain(picture[::-1, ::2]))


def test_droplets_use_numpys_random_numbers(folder):
    compiled.use_libraries_in(folder)
    fast, by = compiled_scattered.build_scattered()
    compiled.use_libraries_in(None)
    assert by
    for before in range(3):
        for shape, count in (((480, 640), 1), ((480, 640), 15_000), ((1, 3), 40), ((720, 1279), 150_001)):
            one, other = (np.random.Generator(np.random.PCG64([count, before])) for _ in range(2))
            for random in (one, other):
                random.random(before, np.float32)
            seen = scattered.droplets(one, shape, count)
            assert np.array_equal(fast.droplets(other, shape, count), seen)


@pytest.mark.parametrize("source", C_SOURCES, ids=lambda source: source.stem)
def test_an_edited_effect_does_not_use_its_library(folder, tmp_path, monkeypatch, source):
    compiled.use_libraries_in(folder)
    assert compiled.library(source) is not None
    named = compiled.stands_for(source.read_bytes())
    for name in (source.name, *named):
        shutil.copy(source.with_name(name), tmp_path)
    assert compiled.library(tmp_path / source.name) is not None
    for name in named:
        text = (tmp_path / name).read_text()
        (tmp_path / name).write_text(text + "\n")
        assert compiled.library(tmp_path / source.name) is None
        (tmp_path / name).write_text(text)
    compiled.use_libraries_in(None)


def test_the_library_is_not_used_if_opencv_computes_other_bits(folder, monkeypatch):
    compiled.use_libraries_in(folder)
    darker = Gaussian.__call__
    monkeypatch.setattr(Gaussian, "__call__", lambda blur, picture: darker(blur, picture) // 2)
    plain = compiled_precipitation.PYTHON_PARTS
    monkeypatch.setattr(
        compiled_precipitation,
        "PYTHON_PARTS",
        plain._replace(veil_picture=lambda *of: air.veil_picture(*of) // 2),
    )
    caches = compiled_gaussian.agrees, compiled_precipitation.has_identical_parts
    for kept in caches:
        kept.cache_clear()
    assert type(build_gaussian(1.5)) is gaussian.Gaussian
    parts, by = compiled_precipitation.build_precipitation_parts(CameraModel())
    assert parts.particles is particles.Particles and by == ""
    for kept in caches:
        kept.cache_clear()
    compiled.use_libraries_in(None)


def test_a_camera_with_numpy_scalars_uses_python(folder):
    """With NumPy scalars in the camera, NumPy computes in double precision."""
    compiled.use_libraries_in(folder)
    camera = replace(CameraModel(), cx=np.float64(317.9))
    assert precipitation.build_precipitation_parts(camera)[1] == ""
    compiled.use_libraries_in(None)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [effects.PaperRain, effects.PaperSnow, effects.Rain, effects.Snow])
def test_runs_in_weather_have_the_same_bytes(folder, tmp_path, monkeypatch, kind):
    same_runs(folder, tmp_path, monkeypatch, kind, PAPER_DETECTOR)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [effects.CodedRain, effects.CodedSnow])
def test_runs_in_weather_as_coded_have_the_same_bytes(folder, tmp_path, monkeypatch, kind):
    same_runs(folder, tmp_path, monkeypatch, kind, AUTHORS_CODE_DETECTOR)


def same_runs(folder, tmp_path, monkeypatch, kind, detector):
    look, scenario = PictureCamera.look, load_scenario(SCENARIO)
    amount = AMOUNTS_BY_EFFECT[kind][4]

    def driven(libraries):
        compiled.use_libraries_in(libraries)
        weather = []

        def in_weather(camera, truth):
            if not weather:
                weather.append(kind(amount, 5, camera.model))
            view = look(camera, truth)
            return view._replace(picture=weather[0].apply(view.picture, truth))

        monkeypatch.setattr(PictureCamera, "look", in_weather)
        pictures = PictureOptions(detector=detector, cache=tmp_path / "frames")
        (tmp_path / "frames" / "detections-1.table").unlink(missing_ok=True)
        out = tmp_path / ("fast" if libraries else "plain")
        write_run(simulate(scenario, 0, pictures), out)
        assert bool(weather[0]._key[-1]) == (libraries is not None and kind is not effects.PaperSnow)
        return [(out / name).read_bytes() for name in ("record.json", "trace.npz")]

    assert driven(folder) == driven(None)
    compiled.use_libraries_in(None)
