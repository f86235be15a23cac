"""Regions of warped images equal those of OpenCV's whole image, with the compiled code and with OpenCV."""

import ctypes
import subprocess

import cv2
import numpy as np
import pytest
from selfdrive.common import compiled
from selfdrive.common.array_math import product
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import compile_helpers, compiled_warp
from selfdrive.sim.compiled_warp import CompiledWarp, build_warp, has_identical_warp
from selfdrive.sim.picture import Region, whole
from selfdrive.sim.road_renderer import car_to_road, picture_to_car
from selfdrive.sim.warp import warp

needs_compiler = pytest.mark.skipif(not compile_helpers.compiler_command(), reason="there is no C compiler")
TO_CAR = picture_to_car(CameraModel(), 172)
SHAPE = 308, 640


@pytest.fixture(scope="module")
def library(all_compiled):
    compiled.use_libraries_in(all_compiled)
    yield compiled.library(compiled_warp.C_SOURCE)
    compiled.use_libraries_in(None)


def moves(random):
    """Yield homographies for cars slightly, far and absurdly far off the middle, and impossible
    homographies."""
    for offset, heading in random.normal(0.0, 1.0, (12, 2)) * ((0.5, 0.02),):
        yield product(product(np.linalg.inv(TO_CAR), car_to_road(0.0, offset, heading)), TO_CAR)
    for offset, heading in ((9.0, 0.4), (-30.0, 1.5), (0.0, 3.0)):
        yield product(product(np.linalg.inv(TO_CAR), car_to_road(0.0, offset, heading)), TO_CAR)
    for scale in (1e-3, 1.0, 1e4, 1e30):
        yield np.eye(3) + scale * random.normal(size=(3, 3))
    yield np.zeros((3, 3))
    for wrong in (np.inf, -np.inf, np.nan):
        yield np.array([(1.0, 0.0, wrong), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])


def sources(random):
    stripes = np.tile(np.array([0, 255], np.uint8), SHAPE[0] * SHAPE[1] // 2).reshape(SHAPE)
    return random.integers(0, 256, SHAPE, np.uint8), stripes, np.full(SHAPE, 255, np.uint8)


def test_a_region_equals_that_of_opencvs_whole_image():
    random = np.random.default_rng(1)
    for matrix in moves(random):
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        for source in sources(random):
            seen = cv2.warpPerspective(
                source, matrix, SHAPE[::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE
            )
            for region in (Region(33, 145, 73, 553), Region(0, 1, 0, 1), Region(307, 308, 639, 640)):
                assert np.array_equal(warp(source, matrix, region), seen[region.part])


@needs_compiler
def test_compiled_warps_have_the_same_bits(library):
    if not has_identical_warp(library):
        pytest.skip("OpenCV computes different bits from the C code")
    random, fast = np.random.default_rng(2), CompiledWarp(library)
    for matrix in moves(random):
        for source in sources(random):
            expected = warp(source, matrix, whole(SHAPE))
            assert np.array_equal(fast(source, matrix, whole(SHAPE)), expected)
            top, left = random.integers(0, SHAPE)
            bottom, right = random.integers((top + 1, left + 1), (SHAPE[0] + 1, SHAPE[1] + 1))
            region = Region(*map(int, (top, bottom, left, right)))
            assert np.array_equal(fast(source, matrix, region), expected[region.part])
            wide = np.repeat(source, 2, axis=1)[:, ::2]
            assert np.array_equal(fast(wide, matrix, region), expected[region.part])


@needs_compiler
@pytest.mark.parametrize("option", ["-DIS_FAST=0", "-DIS_WIDE=0"])
def test_results_do_not_depend_on_wide_vector_instructions(library, tmp_path, option):
    words = [*compile_helpers.compiler_command(), option, compiled_warp.C_SOURCE, "-o", tmp_path / "warp.so"]
    subprocess.run([*words, *compile_helpers.COMPILER_OPTIONS], check=True)
    narrow = compiled.Library(ctypes.CDLL(str(tmp_path / "warp.so")), b"")
    random, fast = np.random.default_rng(5), CompiledWarp(library)
    for matrix in moves(random):
        for source in sources(random):
            expected = fast(source, matrix, whole(SHAPE))
            assert np.array_equal(CompiledWarp(narrow)(source, matrix, whole(SHAPE)), expected)


@needs_compiler
@pytest.mark.parametrize("shape", [(50, 100), (64, 64), (3, 65), (1, 200), (2, 64)])
def test_pictures_of_any_size_are_warped(library, shape):
    if not has_identical_warp(library):
        pytest.skip("OpenCV computes different bits from the C code")
    random, fast = np.random.default_rng(3), CompiledWarp(library)
    for _ in range(20):
        source = random.integers(0, 256, shape, np.uint8)
        matrix = np.eye(3) + random.normal(0.0, (0.1, 0.1, 3.0), (3, 3)) * ((1.0,), (1.0,), (1e-3,))
        assert np.array_equal(fast(source, matrix, whole(shape)), warp(source, matrix, whole(shape)))


@needs_compiler
def test_float_images_are_warped_by_opencv(library):
    """A fault can produce a float image."""
    source = np.random.default_rng(4).random(SHAPE).astype(np.float32)
    region = Region(5, 9, 3, 200)
    assert np.array_equal(CompiledWarp(library)(source, np.eye(3), region), source[region.part])


@needs_compiler
def test_the_library_is_not_used_if_opencv_computes_other_bits(library, monkeypatch):
    def rounds_otherwise(source, matrix, region):
        return warp(source, matrix * (1.0 + 1e-7), region)

    monkeypatch.setattr(compiled_warp, "warp", rounds_otherwise)
    has_identical_warp.cache_clear()
    assert build_warp() == (rounds_otherwise, "")
    has_identical_warp.cache_clear()


@needs_compiler
def test_without_a_library_opencv_warps(library):
    assert isinstance(library.code, ctypes.CDLL)
    folder, compiled._folder = compiled._folder, None
    assert build_warp() == (warp, "")
    compiled._folder = folder
