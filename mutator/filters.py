"""Filter expressions over table columns (`--only`, `--exclude`): parsed, never evaluated as code."""

from collections.abc import Callable, Collection, Mapping


def compile_filter(text: str, columns: Collection[str]) -> Callable[[Mapping[str, object]], bool]:
    """A predicate over rows, e.g. `fault_type == "chaff" and scenario in ("S1", "S2") and value > 100`.

    Allowed: the columns, numbers, strings, tuples and lists of them, comparisons, `in`, `not in`, and/or/not,
    parentheses; `~` as infix is not known, use `match(column, "glob*")`. A comparison with an empty cell is
    false. MutatorError shows the text, the place and the known columns.
    """
    raise NotImplementedError
