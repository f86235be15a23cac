"""Python without its numbers and ids: of texts that have one skeleton, all compile when the skeleton does.

`compile` takes milliseconds for a file, and mutants of one shape differ in nothing but the digits of their
numbers and in their ids. So the skeleton is compiled, once, and stands for all of them:

* A number is replaced by 0, one with a point or an exponent by 0.0. Only whole literals are, as `repr` writes
  them, of a length that Python reads without limits: a token gives way to one of the same kind. What the
  compiler asks of a literal is its kind; where it asks for more (no two equal keys in a mapping pattern), all
  being equal is the hardest case.
* An id (hex digits) is replaced by one that is no token by itself (`0f...`) and no character (`\\U0f...`), so
  a skeleton compiles only where ids stand in texts, comments or in names; there any id will do. Equal ids
  stay equal, different ones different.
"""

import re
from collections.abc import Iterable
from functools import lru_cache

_PART = r"[\w.\\\x80-\U0010ffff]"  # beside a literal: it goes on, or is part of a name or an escape
_NUMBER = re.compile(  # the digit first, since the search for it is quick; only then what stands before it
    rf"[0-9](?<!{_PART}[0-9])(?:(?<!0)[0-9]{{1,19}})?((?:\.[0-9]{{1,20}})?(?:e[+-]?[0-9]{{1,3}})?)(?!{_PART})"
)


def skeleton(text: str, ids: Iterable[str]) -> str:
    """`text` with its numbers and `ids` replaced."""
    for i, name in enumerate(ids):
        text = text.replace(name, f"0f0f{i:04x}")
    return _NUMBER.sub(_zero, text)


def _zero(number: re.Match[str]) -> str:
    return "0.0" if number[1] else "0"


@lru_cache(maxsize=256)
def compiles(text: bytes) -> bool:
    """Whether a skeleton compiles, and so every text that has it."""
    try:
        compile(text, "<skeleton>", "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError):
        return False
    return True
