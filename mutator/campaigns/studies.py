"""Studies that are installed: published work that a campaign may reproduce, each a package of its own.

A package registers its study as an entry point of the group `mutator.studies`; a campaign asks for it by name
(`study:`). What a study adds to a report is in `mutator.report.studies`.
"""

from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Protocol, cast

from mutator.errors import MutatorError
from mutator.workspace import Workspace

GROUP = "mutator.studies"


class Study(Protocol):
    """What every study can do."""

    def check(self, workspace: Workspace) -> Iterable[MutatorError]:
        """Problems of the study's data in a fault library."""
        ...


def study_names() -> tuple[str, ...]:
    """The studies installed here, sorted."""
    return tuple(sorted(entry_points(group=GROUP).names))


def find_study(name: str) -> Study:
    """The study of that name; MutatorError that lists the known ones if it is not installed, or that says why
    it cannot be loaded."""
    found = entry_points(group=GROUP, name=name)
    if not found:
        known = ", ".join(study_names()) or "none"
        raise MutatorError(
            f"study '{name}' is not installed", expected=f"one of {known}", remedy="install its package"
        )
    try:
        return cast(Study, next(iter(found)).load())
    except (ImportError, AttributeError) as err:
        raise MutatorError(
            f"study '{name}' cannot be loaded: {err}",
            remedy="correct or reinstall its package",
        ) from err
