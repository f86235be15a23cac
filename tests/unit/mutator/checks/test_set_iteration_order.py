"""Places that depend on the order of a set are found by reading the source."""

import pytest

from mutator.checks.set_iteration_order import list_set_order_uses


@pytest.mark.parametrize(
    "line",
    [
        "for x in {a, b}: f(x)",
        "for x in set(b): f(x)",
        "y = [f(x) for x in {a, b}]",
        "y = list({a, b} | c)",
        "y = tuple(frozenset(c))",
        "y = next(iter(set(c)))",
        "y = ','.join({str(x) for x in c})",
        "y = sum({a, b})",
        "y = set(c).pop()",
        "y = [*set(c)]",
        "for x in a.keys() & b.keys(): f(x)",
        "y = set(c)\nz = y.union(b)\nfor x in z: f(x)",
        "y: set[str] = c\nfor x in y: f(x)",
        "class A:\n    def f(self):\n        self.y = set()\n    def g(self):\n        return list(self.y)",
    ],
)
def test_code_that_depends_on_the_order_of_a_set_is_found(line: str) -> None:
    assert len(list_set_order_uses(line.encode())) == 1


@pytest.mark.parametrize(
    "line",
    [
        "for x in sorted({a, b}): f(x)",
        "y = len({a, b})",
        "y = max(f(x) for x in {a, b})",
        "y = {f(x) for x in {a, b}}",
        "y = a in {a, b}",
        "for x in [a, b]: f(x)",
        "y = {a: b}.pop(a)",
        "y = set(c)\ndef g(y):\n    return list(c)",
        "this is no Python",
    ],
)
def test_code_that_needs_no_order_is_not_reported(line: str) -> None:
    assert list_set_order_uses(line.encode()) == []


def test_a_place_has_its_line_and_function() -> None:
    source = (
        b"class A:\n    def f(self):\n        names = {'a', 'b'}\n        for n in names:\n            g(n)\n"
    )
    (place,) = list_set_order_uses(source)
    assert (place.line, place.function, place.set_source) == (4, "A.f", "names")
