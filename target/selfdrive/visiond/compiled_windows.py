"""Finds windows with a lane mark in compiled C, like Hog and LaneNet."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.array_math import vector_lengths
from selfdrive.visiond.hog import BLOCK_FEATURES, CELL_PIXELS, ORIENTATION_BINS, WINDOW_FEATURES
from selfdrive.visiond.lane_net import FEATURE_STEPS, HIDDEN_NODES, WEIGHT_STEPS, LaneNet

C_SOURCE = Path(__file__).with_name("mark_windows.c")
MOST_WEIGHT_STEPS = 2**13  # largest number of weight steps per unit in the coarse score
PADDED_FEATURE_COUNT = 1776  # number of a window's features, padded to whole vectors


class _NetStructure(ctypes.Structure):
    _fields_ = (
        ("rows", ctypes.c_int64),
        ("width", ctypes.c_int64),
        ("threshold", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("lengths", "coarse", "whole", "bias", "out")),
        *((name, ctypes.c_float) for name in ("out_bias", "out_size", "coarse_steps")),
        *((name, ctypes.c_void_p) for name in ("squares", "bins", "sums", "cells", "power", "blocks")),
    )


class MarkWindowFinder:
    """Examines windows of pictures of one size with the compiled `mark_windows.c`."""

    def __init__(
        self, net: LaneNet, size: tuple[int, int], threshold: float, library: compiled.Library
    ) -> None:
        rows, width = size
        coarse = np.zeros((HIDDEN_NODES, PADDED_FEATURE_COUNT), np.int16)
        coarse_steps = _coarse_steps(net)
        coarse[:, :WINDOW_FEATURES] = np.rint(net.hidden_steps.T * (coarse_steps / WEIGHT_STEPS))
        down, across = rows // CELL_PIXELS, width // CELL_PIXELS
        self._arrays = {
            "lengths": np.sqrt(np.arange(2 * 255**2 + 1)) / CELL_PIXELS**2,
            "coarse": coarse,
            "whole": net.hidden_steps,
            "bias": net.hidden_bias,
            "out": net.out,
            "squares": np.zeros(width, np.int32),
            "bins": np.zeros(width, np.int32),
            "sums": np.zeros(across * ORIENTATION_BINS),
            "cells": np.zeros((down, across, ORIENTATION_BINS), np.float32),
            "power": np.zeros((down, across), np.float32),
            "blocks": np.zeros((down - 1, across - 1, BLOCK_FEATURES), np.int16),
        }
        self.blocks = self._arrays["blocks"]  # of the windows examined last, in steps
        pointers = {name: array.ctypes.data for name, array in self._arrays.items()}
        self._net = _NetStructure(
            rows=rows,
            width=width,
            threshold=threshold,
            out_bias=net.out_bias[0],
            out_size=float(np.abs(net.out).sum()) * 1.001,
            coarse_steps=coarse_steps,
            **pointers,
        )
        self._which = library.code.which
        self._which.argtypes = [ctypes.c_void_p] * 3
        self._which.restype = ctypes.c_long
        self._at = ctypes.addressof(self._net)

    def clear_windows_without_mark(self, part: int, windows: int) -> bool:
        """Clear the windows (bool, at the address `windows`) that have no mark.

        `part` is the address of the picture (uint8). Returns False if the Python code must decide.
        """
        return bool(self._which(self._at, part, windows))


def _coarse_steps(net: LaneNet) -> float:
    """Largest number of steps per unit for which weights fit into 16 bits and all sums into 32.

    Features are not negative and a block's norm is at most 1, so the block adds at most the norm of its
    positive weights, or of its negative ones.
    """
    blocks = net.hidden.T.reshape(HIDDEN_NODES, -1, BLOCK_FEATURES).astype(float)
    signs = [np.maximum(part, 0.0) for part in (blocks, -blocks)]
    largest = max(vector_lengths(part).sum(axis=(1, 2)).max() for part in signs)
    steps = float(MOST_WEIGHT_STEPS)
    while steps * largest * FEATURE_STEPS > 0.99 * 2**31 or steps * np.abs(blocks).max() > 2**15 - 1:
        steps *= 0.5
    return steps
