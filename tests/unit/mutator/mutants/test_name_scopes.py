"""Scopes: the names that a function knows, and the names whose meaning inserted lines would change."""

import sys

import pytest

from mutator.mutants.name_scopes import RescopedName, rescoped_names, used_names_by_function

SOURCE = """\
limit = 3
class _Car:
    __seat = 1
    def go(self, x):
        __own = x.speed + limit
        def inner(y, more=[i for i in x]):
            return y + __own
        return inner(max(x, key=lambda z: far))
def genexpr(x=(i for i in 'ab')): return (µ for µ in x)
"""


def test_a_function_knows_its_own_and_outer_names() -> None:
    names = used_names_by_function(SOURCE.encode())
    go = names[4, "go"]
    assert {"self", "x", "__own", "limit", "inner", "max"} <= go
    assert not {"speed", "y", "key", "z", "far", "__seat"} & go
    assert {"y", "__own"} <= names[6, "inner"]
    assert names[9, "genexpr"] == {"x"} | (names[9, "genexpr"] & {"μ"})


def test_the_files_encoding_is_used() -> None:
    latin = "# coding: latin-1\ndef f(\xe9): return \xe9\n".encode("latin-1")
    assert used_names_by_function(latin) == {(2, "f"): {"\xe9"}}
    assert used_names_by_function("\ufeffdef f(\xe9): pass\r\n".encode()) == {(1, "f"): {"\xe9"}}


READS = "def f(x):\n    #\n    return limit + x\n"
NESTED = "def f(x):\n    #\n    def g(): return limit\n    return g\n"
ENCLOSED = "def f(x):\n    def g():\n        #\n        return x\n    return g\n"
ANNOTATED = "def f(x):\n    #\n    def g(y: limit): return y\n    return g\n"
CLASS = "class C:\n    def f(self):\n        #\n        return __x\n"


@pytest.mark.parametrize(
    ("source", "inserted", "moved"),
    [
        (READS, "limit = 1", ("limit", "f", "global or built-in", "local")),
        (READS, "limit += 1", ("limit", "f", "global or built-in", "local")),
        (READS, "del limit", ("limit", "f", "global or built-in", "local")),
        (READS, "import limit.x", ("limit", "f", "global or built-in", "local")),
        (READS, "[(limit := i) for i in x]", ("limit", "f", "global or built-in", "local")),
        (READS, "for limit in x: pass", ("limit", "f", "global or built-in", "local")),
        (READS, "class limit: pass", ("limit", "f", "global or built-in", "local")),
        (READS.replace("limit", "max(x)"), "max = 1", ("max", "f", "global or built-in", "local")),
        (NESTED, "limit = 1", ("limit", "g", "global or built-in", "nonlocal")),
        (NESTED.replace("def g(): return", "class C: x ="), "limit = 1",
         ("limit", "C", "global or built-in", "nonlocal")),
        (NESTED.replace("def g(): return limit", "g = lambda: limit"), "limit = 1",
         ("limit", "lambda", "global or built-in", "nonlocal")),
        (ENCLOSED, "x = 1", ("x", "g", "nonlocal", "local")),
        (CLASS, "__x = 1", ("_C__x", "f", "global or built-in", "local")),
        ("def f():\n    #\n    x = 1\n", "global x", ("x", "f", "local", "global or built-in")),
        (READS, "y = x", None),
        (READS, "x = 1", None),
        (READS, "self.limit = [limit for limit in x]", None),
        (READS, "x = lambda limit: limit", None),
        (READS, "y = lambda: x", None),
        ("def f(x):\n    global limit\n    #\n    return limit + x\n", "limit = 1", None),
        ("def f(x):\n    def g():\n        nonlocal x\n        #\n        x\n    return g\n", "x = 1", None),
        ("def f(x):\n    #\n    return x.limit(limit=1)\n", "limit = 1", None),
        (CLASS, "__y = 1", None),
        (ANNOTATED, "_: int = 1", None),
        (ANNOTATED, "y = 1", None),
        ("def f(x):\n    #\n    y: int = limit\n    g = lambda: limit\n", "_: int = 1", None),
    ],
)  # fmt: skip
def test_an_inserted_binding_can_change_the_scope_of_a_name(
    source: str, inserted: str, moved: tuple[str, str, str, str] | None
) -> None:
    place = next(i for i, line in enumerate(source.splitlines(), 1) if line.strip() == "#")
    made = source.replace("#", inserted)
    found = next(rescoped_names(source.replace("#", "pass").encode(), made.encode(), {place}), None)
    expected = moved and RescopedName(
        name=moved[0], function_or_class=moved[1], scope_before=moved[2], scope_after=moved[3]
    )
    assert found == expected


def test_an_inserted_binding_can_change_the_scope_of_a_name_in_an_annotation() -> None:
    """Since Python 3.14, annotations have a scope of their own."""
    made = ANNOTATED.replace("#", "limit = 1")
    (found,) = rescoped_names(ANNOTATED.replace("#", "pass").encode(), made.encode(), {2})
    deferred = ("the annotations of line 3", "nonlocal")
    assert (found.function_or_class, found.scope_after) == (
        deferred if sys.version_info >= (3, 14) else ("f", "local")
    )
    assert (found.name, found.scope_before) == ("limit", "global or built-in")
