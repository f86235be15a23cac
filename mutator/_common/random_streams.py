"""Seeded random generators, one for each (seed, key), so that no draw depends on earlier draws."""

import hashlib

import numpy as np

from mutator.errors import MutatorError

_VALUES_PER_SEED_WORD = 2**32  # NumPy seeds its generators with words of 32 bits


def random_generator(seed: int, key: str) -> np.random.Generator:
    if not 0 <= seed < 2**63:
        raise MutatorError(f"seed {seed}", expected="a number from 0 to 2**63 - 1")
    key_words = np.frombuffer(hashlib.sha256(key.encode()).digest(), dtype=">u4")
    # the words that NumPy derives from [seed, *words], computed ten times as fast
    seed_words = (
        [seed]
        if seed < _VALUES_PER_SEED_WORD
        else [seed % _VALUES_PER_SEED_WORD, seed // _VALUES_PER_SEED_WORD]
    )
    return np.random.Generator(np.random.PCG64(np.concatenate((seed_words, key_words)).astype(np.uint32)))
