"""The trace file has the bytes that NumPy's `savez` writes."""

import io

import numpy as np
import pytest
from selfdrive.sim.trace_file import npz_pieces


@pytest.mark.parametrize("rows", [0, 1, 3000])
def test_the_file_has_the_bytes_of_savez(rows):
    values = np.random.default_rng(rows).normal(size=(rows, 3))
    values[1:2] = [np.nan, -0.0, np.inf]
    trace = {
        "t": np.arange(float(rows)),
        "apart": values[:, 1],
        "alert": np.arange(rows, dtype=np.int32),
        "a_long_name": values[:, 2].copy(),
    }
    expected = io.BytesIO()
    np.savez(expected, **trace)
    assert b"".join(npz_pieces(trace)) == expected.getvalue()


def test_a_trace_without_channels_is_an_empty_archive():
    expected = io.BytesIO()
    np.savez(expected)
    assert b"".join(npz_pieces({})) == expected.getvalue()
