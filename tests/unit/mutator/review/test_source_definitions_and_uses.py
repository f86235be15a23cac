"""Names that code uses."""

import ast

from mutator.review.source_definitions_and_uses import external_names_used_in

SOURCE = """\
import tools

@tools.timed
def first():
    local = 1
    return helper(local)

def second():
    return other()
"""


class Lines:
    """Selects all nodes in some lines, and notes which lines were asked for."""

    def __init__(self, *lines: int) -> None:
        self.lines, self.ranges = lines, []  # type: tuple[int, ...], list[tuple[int, int]]

    def __contains__(self, node: ast.expr) -> bool:
        return node.lineno in self.lines

    def may_contain(self, first_line: int, last_line: int) -> bool:
        self.ranges.append((first_line, last_line))
        return any(first_line <= line <= last_line for line in self.lines)


def names(selection: Lines | None) -> list[tuple[str, ...]]:
    return [use.name_parts for use in external_names_used_in(ast.parse(SOURCE), selection=selection)]


def test_only_selected_parts_are_searched() -> None:
    """A local variable stays local, a decorator belongs to its function, and other functions are skipped."""
    assert names(None) == [("tools", "timed"), ("helper",), ("other",)]
    assert names(Lines(3)) == [("tools", "timed")]
    within_first = Lines(6)
    assert names(within_first) == [("helper",)]
    assert within_first.ranges == [(1, 1), (3, 6), (5, 5), (6, 6), (8, 9)]
