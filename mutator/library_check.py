"""Is everything in the library usable? What `mutator check` asks."""

from mutator.errors import MutatorError
from mutator.workspace import Workspace


def check_library(workspace: Workspace, target: str = "openpilot") -> list[MutatorError]:
    """Every problem of library, templates and target, in the order of the files; empty when all is well.

    Checks that manifests, models, specs, hazards and context tables load; that the models' examples hold;
    that every spec expands in both readings; that every anchor is found in the target exactly once; and that
    one mutant of every shape compiles and un-splices.
    """
    raise NotImplementedError
