r"""Normalize numbers and ids in source, so that one compilation covers many mutants.

Mutants of one kind differ only in the digits of their numbers and in their ids. If the normalized source
compiles, so does every source that normalizes to it:

* A number becomes 0, or 0.0 if it has a point or an exponent. Only whole literals as `repr` writes them are
  replaced, up to a length that Python always accepts. So every token keeps its kind. Where the compiler
  compares values (a mapping pattern must not repeat a key), equal numbers are the worst case.
* An id (hex digits) becomes one that is neither a valid token (`0f...`) nor a valid character (`\U0f...`).
  So normalized source compiles only if its ids are in strings, comments or names, where any id compiles.
  Equal ids stay equal, and different ids stay different.
"""

import re
from collections.abc import Iterable
from functools import lru_cache

_TOKEN_PART_PATTERN = r"[\w.\\\x80-\U0010ffff]"  # next to these, digits are part of a longer token
_NUMBER_PATTERN = re.compile(  # the digit precedes the lookbehind because searching for it is fast
    rf"[0-9](?<!{_TOKEN_PART_PATTERN}[0-9])(?:(?<!0)[0-9]{{1,19}})?((?:\.[0-9]{{1,20}})?(?:e[+-]?[0-9]{{1,3}})?)(?!{_TOKEN_PART_PATTERN})"
)


def normalize_numbers_and_ids(text: str, ids: Iterable[str]) -> str:
    for i, name in enumerate(ids):
        text = text.replace(name, f"0f0f{i:04x}")
    return _NUMBER_PATTERN.sub(_zero_like, text)


def _zero_like(number: re.Match[str]) -> str:
    return "0.0" if number[1] else "0"


@lru_cache(maxsize=256)
def normalized_source_compiles(text: bytes) -> bool:
    """Return whether normalized source, and so every source that normalizes to it, compiles."""
    try:
        compile(text, "<normalized>", "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return False
    return True
