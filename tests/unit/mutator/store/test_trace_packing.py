"""Packed files of golden runs: every byte comes back, and damaged ones are refused."""

import lzma
from collections.abc import Callable
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from mutator.store.trace_packing import pack_file, unpack_file

SHAPES = arrays.array_shapes(max_dims=2, min_side=0, max_side=30)
NUMBERS = st.sampled_from(["<f8", "<f4", "<i8", "<i4", ">f8", "<u2", "?", "<U3"]).flatmap(
    lambda kind: arrays.arrays(kind, SHAPES)
)


def npz(save: Callable[..., None] = np.savez, **channels: np.ndarray) -> bytes:
    file = BytesIO()
    save(file, **channels)
    return file.getvalue()


@given(st.lists(NUMBERS, max_size=4), st.sampled_from([np.savez, np.savez_compressed]), st.binary(max_size=9))
def test_every_byte_of_an_npz_file_comes_back(
    channels: list[np.ndarray], save: Callable[..., None], after: bytes
) -> None:
    """Also of numbers such as NaN with a payload, infinities, and minus zero."""
    data = npz(save, **{f"c{number}": channel for number, channel in enumerate(channels)}) + after
    assert unpack_file(pack_file(data)) == data


@given(st.binary(max_size=300))
def test_every_byte_of_any_other_file_comes_back(data: bytes) -> None:
    assert unpack_file(pack_file(data)) == data


@given(st.data())
def test_every_byte_of_a_damaged_npz_file_comes_back(data: st.DataObject) -> None:
    """Whatever its directory says about entries that overlap or lie outside."""
    whole = bytearray(npz(a=np.arange(9.0), b=np.arange(5, dtype="<i4")))
    for place in data.draw(st.lists(st.integers(0, len(whole) - 1), max_size=6)):
        whole[place] = data.draw(st.integers(0, 255))
    assert unpack_file(pack_file(bytes(whole))) == bytes(whole)


def test_a_smooth_trace_takes_a_fraction_of_its_bytes() -> None:
    t = np.arange(3000) * 0.01
    data = npz(t=t, speed=20 + np.sin(t), gap=30 * np.exp(-t / 9))
    assert len(pack_file(data)) < len(data) / 6


@given(st.data())
def test_damaged_packed_bytes_are_refused(data: st.DataObject) -> None:
    """A changed byte gives an error, or, where it means nothing, the same file."""
    whole = npz(a=np.arange(50.0))
    packed = bytearray(pack_file(whole))
    place = data.draw(st.integers(0, len(packed) - 1))
    packed[place] ^= data.draw(st.integers(1, 255))
    try:
        unpacked = unpack_file(bytes(packed))
    except ValueError:
        return
    assert unpacked == whole


@pytest.mark.parametrize(
    "arrays_text",
    [
        '[[0,"<f8",9999999999,0]]',
        '[[-5,"<f8",0,0]]',
        '[[0,"<f8",-1,0]]',
        '[[0,"|O",1,0]]',
        '[[0,"<f8",0,99]]',
        '[["0","<f8",0,0]]',
        '[[0,"<f8",1.5,0]]',
        "[[0]]",
        "{}x",
        "[" * 100_000,
    ],
)
def test_forged_arrays_are_refused(arrays_text: str) -> None:
    text = arrays_text.encode()
    with pytest.raises(ValueError, match="not a packed file"):
        unpack_file(lzma.compress(len(text).to_bytes(4, "little") + text))


def test_a_bomb_is_refused() -> None:
    """Some kilobytes can unpack to gigabytes."""
    with pytest.raises(ValueError, match="too large"):
        unpack_file(lzma.compress(bytes(130_000_000), preset=0))
