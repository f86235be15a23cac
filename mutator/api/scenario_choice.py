"""Scenarios as a user names them: in the library, a file, or a family with values."""

from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.message_text import describe_choices
from mutator.errors import MutatorError
from mutator.model import ConcreteScenario
from mutator.workspace import Workspace

ScenarioLike = str | Path | ConcreteScenario


def concrete_scenario_of(workspace: Workspace, scenario: ScenarioLike) -> ConcreteScenario | None:
    """Return the concrete scenario, if `scenario` is one or names one; MutatorError as `Workspace` raises."""
    if isinstance(scenario, ConcreteScenario):
        return scenario
    return workspace.concrete_scenario(str(scenario))


def digest_of_library_scenario(workspace: Workspace, name: str) -> str:
    """Return the digest of a scenario's file; MutatorError unless `name` is a scenario of the library."""
    names = workspace.scenarios
    if name not in names:
        raise MutatorError(
            f"no scenario '{name}'",
            argument="scenario",
            expected=f"{describe_choices(names)}, as in the library, or a family with values",
            remedy="correct the name, or add the file to the library",
        )
    return digest(read_bounded(workspace.scenario(name)))
