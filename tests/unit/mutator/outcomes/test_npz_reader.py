"""The fast reader of uncompressed .npz files returns the same arrays as numpy."""

import io
import zipfile

import numpy as np
import pytest

from mutator.outcomes import npz_reader

ARRAYS = {
    "t": np.arange(5) * 0.01,
    "gear": np.arange(5, dtype=np.int32),
    "on": np.array([True, False, True, False, True]),
    "none": np.empty(0),
    "table": np.arange(6.0).reshape(2, 3),
}


def written(save=np.savez, **arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return buffer.getvalue()


def test_the_fast_reader_returns_the_same_arrays_as_numpy() -> None:
    found = npz_reader.read_members(written(**ARRAYS))
    assert found is not None
    assert list(found) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
        assert np.array_equal(found[name], array)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"something else than a file of arrays, and longer than an empty one",
        written(np.savez_compressed, t=np.arange(100.0)),
        written(t=np.asfortranarray(np.arange(6.0).reshape(2, 3))),
        written(t=np.array(["text"])),
        written(t=np.arange(3.0)) + b"more",
    ],
)
def test_unusual_files_are_left_to_numpy(data: bytes) -> None:
    assert npz_reader.read_members(data) is None


def headed(header: bytes) -> bytes:
    data = written(t=np.arange(3.0))
    there = data[data.index(b"{'descr'") : data.index(b"\n", data.index(b"{'descr'"))]
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        member = file.read("t.npy").replace(there, header.ljust(len(there)))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("t.npy", member)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "shape", ["(3,)", "(-1,)", "(3, -1)", "(2,)", "(4,)", "(0,)", "(True,)", "(3,", "(%s,)" % ("9" * 30)]
)
def test_any_header_is_read_as_numpy_reads_it(shape: str) -> None:
    """A mutant can write an invalid header with a valid checksum."""
    data = headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': " + shape.encode() + b"}")
    found = npz_reader.read_members(data)
    if shape == "(3,)":
        assert found is not None
    if found is not None:
        assert np.array_equal(found["t"], np.load(io.BytesIO(data))["t"])


def test_a_flipped_bit_never_changes_the_arrays() -> None:
    data = written(t=np.arange(3.0), x=np.arange(3, dtype=np.int32))
    for place in range(len(data)):
        found = npz_reader.read_members(data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :])
        if found is not None and list(found) == ["t", "x"]:
            assert np.array_equal(found["t"], np.arange(3.0))
            assert np.array_equal(found["x"], np.arange(3))
    for end in range(len(data)):
        assert npz_reader.read_members(data[:end]) is None
