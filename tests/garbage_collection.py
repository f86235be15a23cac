"""Keeps garbage collections of a test session short: each in-process campaign collects several times."""

import gc
import sys

_MANY_MODULES = 100
_module_counts: list[int] = []  # how many modules were loaded when objects were last exempted


def exempt_objects_from_collection() -> None:
    """Exempt the objects that exist now."""
    gc.collect()
    gc.freeze()
    _module_counts[:] = [len(sys.modules)]


def exempt_late_modules_from_collection() -> None:
    """Exempt what tests import late, such as pandas and matplotlib, which have most of all objects."""
    if _module_counts and len(sys.modules) > _module_counts[0] + _MANY_MODULES:
        exempt_objects_from_collection()
