"""Garbage collection is disabled for a while."""

import gc

import pytest

from mutator._common.garbage_collection_pause import without_garbage_collection


def test_collection_is_as_before_after_the_block() -> None:
    """It is enabled again after an error, too, and stays disabled where it was."""
    assert gc.isenabled()
    with pytest.raises(KeyError), without_garbage_collection():
        assert not gc.isenabled()
        raise KeyError
    assert gc.isenabled()
    with without_garbage_collection():
        with without_garbage_collection():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()
