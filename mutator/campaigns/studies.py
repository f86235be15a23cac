"""Installed studies: published works that a campaign can reproduce, each in a separate package.

A package registers its study as an entry point of the group `mutator.studies`; a campaign names it with
`study:`. `mutator.report.studies` defines what a study adds to a report.
"""

from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Any, Protocol, cast

from mutator.errors import MutatorError
from mutator.workspace import Workspace

GROUP = "mutator.studies"
FUNCTIONS = ("check", "published", "drawings")
PARTS = ("about", "panels", *FUNCTIONS)
"""Required attributes of an entry point's object: the fields of `mutator.report.studies.Study`, which this
layer is not allowed to import.
"""


class Study(Protocol):
    """The interface of a study."""

    def check(self, workspace: Workspace) -> Iterable[MutatorError]:
        """Return the problems of the study's data in a fault library."""
        ...


def study_names() -> tuple[str, ...]:
    return tuple(sorted(entry_points(group=GROUP).names))


def find_study(name: str) -> Study:
    """Load the study of that name; MutatorError if it is not installed, cannot be loaded or is invalid."""
    found = entry_points(group=GROUP, name=name)
    if not found:
        remedy = "correct the name, or install the package that provides the study"
        raise _refused(name, f"study '{name}' is not installed", remedy)
    [point, *_] = found
    remedy = "correct or reinstall the package that provides it"
    try:
        loaded = point.load()
    except Exception as err:  # importing it runs third-party code
        why = f"{type(err).__name__}: {err}"
        raise _refused(name, f"study '{name}' cannot be loaded: {point.value}: {why}", remedy) from err
    if wrong := _wrong(loaded):
        raise _refused(name, f"study '{name}' is not a study: {point.value} {wrong}", remedy)
    return cast(Study, loaded)


def study_problems(name: str, study: Study, workspace: Workspace) -> list[MutatorError]:
    """Return the problems of a study's data in a fault library. Exceptions from the check are included."""
    try:
        problems = list(study.check(workspace))
    except MutatorError as error:
        return [error]
    except Exception as err:  # third-party code
        return [_bad_check(name, f"fails: {type(err).__name__}: {err}")]
    if strangers := [problem for problem in problems if not isinstance(problem, MutatorError)]:
        return [_bad_check(name, f"returned {strangers[0]!r}, which is not a MutatorError")]
    return problems


def _refused(name: str, got: str, remedy: str) -> MutatorError:
    others = [other for other in study_names() if other != name]
    expected = f"one of {', '.join(others)}" if others else "no `study`, because none is installed"
    return MutatorError(got, expected=expected, remedy=remedy)


def _bad_check(name: str, what: str) -> MutatorError:
    return MutatorError(f"the check of study '{name}' {what}", remedy="correct the package that provides it")


def _wrong(loaded: Any) -> str:
    """Return why an object cannot be used as a study; empty if it can be."""
    if missing := [part for part in PARTS if not hasattr(loaded, part)]:
        return f"is a {type(loaded).__name__} without {', '.join(missing)}"
    if isinstance(loaded, type):
        return "is a class, not an instance"
    if idle := [name for name in FUNCTIONS if not callable(getattr(loaded, name))]:
        return f"has no function {', '.join(idle)}"
    if not (isinstance(loaded.panels, tuple | list) and all(map(callable, loaded.panels))):
        return "has panels that are not functions"
    return ""
