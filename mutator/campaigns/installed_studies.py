"""Installed studies: published works that a campaign can reproduce, each in a separate package.

A package registers its study as an entry point of the group `mutator.studies`; a campaign names it with
`study:`. `mutator.report.reported_run` defines what a study adds to a report.
"""

from collections.abc import Iterable
from typing import Protocol, cast

from mutator._common.extension_doors import STUDY_DOOR
from mutator.errors import MutatorError
from mutator.workspace import Workspace


class CheckableStudy(Protocol):
    """The part of a study that concerns campaigns."""

    def check(self, workspace: Workspace) -> Iterable[MutatorError]:
        """Return the problems of the study's data in a fault library."""
        ...


def load_installed_study(name: str) -> CheckableStudy:
    """Load the study of that name; MutatorError if it is not installed, cannot be loaded or is no study."""
    return cast(CheckableStudy, STUDY_DOOR.load(name))


def study_problems(name: str, study: CheckableStudy, workspace: Workspace) -> list[MutatorError]:
    """Return the problems of a study's data in a fault library. Exceptions from the check are included."""
    try:
        problems = list(study.check(workspace))
    except MutatorError as error:
        return [error]
    except Exception as err:  # third-party code
        return [_check_error(name, f"fails: {type(err).__name__}: {err}")]
    if non_errors := [problem for problem in problems if not isinstance(problem, MutatorError)]:
        return [_check_error(name, f"returned {non_errors[0]!r}, which is not a MutatorError")]
    return problems


def _check_error(name: str, what: str) -> MutatorError:
    return MutatorError(f"the check of study '{name}' {what}", remedy="correct the package that provides it")
