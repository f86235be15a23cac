"""Studies that are installed: published work that a campaign may reproduce, each a package of its own.

A package registers its study as an entry point of the group `mutator.studies`; a campaign asks for it by name
(`study:`). What a study adds to a report is in `mutator.report.studies`.
"""

from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Any, Protocol, cast

from mutator.errors import MutatorError
from mutator.workspace import Workspace

GROUP = "mutator.studies"
FUNCTIONS = ("check", "published", "drawings")
PARTS = ("about", "panels", *FUNCTIONS)
"""What an entry point's object must have: the fields of `mutator.report.studies.Study`, which this layer may
not import."""


class Study(Protocol):
    """What every study can do."""

    def check(self, workspace: Workspace) -> Iterable[MutatorError]:
        """Problems of the study's data in a fault library."""
        ...


def study_names() -> tuple[str, ...]:
    """The studies installed here, sorted."""
    return tuple(sorted(entry_points(group=GROUP).names))


def find_study(name: str) -> Study:
    """The study of that name, loaded; MutatorError that lists the others if it is not installed, cannot be
    loaded or is no study."""
    found = entry_points(group=GROUP, name=name)
    if not found:
        remedy = "correct the name, or install the package that provides the study"
        raise _refused(name, f"study '{name}' is not installed", remedy)
    [point, *_] = found
    remedy = "correct or reinstall the package that provides it"
    try:
        loaded = point.load()
    except Exception as err:  # importing it runs a stranger's code
        why = f"{type(err).__name__}: {err}"
        raise _refused(name, f"study '{name}' cannot be loaded: {point.value}: {why}", remedy) from err
    if wrong := _wrong(loaded):
        raise _refused(name, f"study '{name}' is no study: {point.value} {wrong}", remedy)
    return cast(Study, loaded)


def study_problems(name: str, study: Study, workspace: Workspace) -> list[MutatorError]:
    """What a study finds wrong with its data in a fault library. A check that itself fails is a problem."""
    try:
        problems = list(study.check(workspace))
    except MutatorError as error:
        return [error]
    except Exception as err:  # a stranger's code
        return [_bad_check(name, f"fails: {type(err).__name__}: {err}")]
    if strangers := [problem for problem in problems if not isinstance(problem, MutatorError)]:
        return [_bad_check(name, f"gives {strangers[0]!r}, which is no MutatorError")]
    return problems


def _refused(name: str, got: str, remedy: str) -> MutatorError:
    others = [other for other in study_names() if other != name]
    expected = f"one of {', '.join(others)}" if others else "no study: there is no other"
    return MutatorError(got, expected=expected, remedy=remedy)


def _bad_check(name: str, what: str) -> MutatorError:
    return MutatorError(f"the check of study '{name}' {what}", remedy="correct the package that provides it")


def _wrong(loaded: Any) -> str:
    """What keeps an object from being used as a study; empty if nothing does."""
    if missing := [part for part in PARTS if not hasattr(loaded, part)]:
        return f"is a {type(loaded).__name__} without {', '.join(missing)}"
    if isinstance(loaded, type):
        return "is a class, not an object of it"
    if idle := [name for name in FUNCTIONS if not callable(getattr(loaded, name))]:
        return f"has no function {', '.join(idle)}"
    if not (isinstance(loaded.panels, tuple | list) and all(map(callable, loaded.panels))):
        return "has panels that are not functions"
    return ""
