"""`verify` compares what an exploration injected with what the library gives."""

from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.audit.run_audit import AuditCheck
from mutator.workspace import Workspace
from tests.e2e.exploration_forging import Explored, explore

CHECK = "planned faults that the library gives"


@pytest.fixture(scope="module")
def equal_sizes(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Explored:
    """An exploration of a library whose errors have all the same size."""
    place = tmp_path_factory.mktemp("equal_sizes")
    workspace = copy_toycar(place)
    edit_distance(workspace, "by_m: distance", "by_m: 0.001")
    explore(workspace, place / "run", "sensor/distance/longer", points=6, longest_s=3.0)
    return workspace, place / "run"


def edit_distance(workspace: Workspace, before: str, after: str) -> None:
    path = workspace.library / "faults" / "sensor" / "distance.yaml"
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))


def library_check(audit: mutator.Audit) -> AuditCheck:
    return next(check for check in audit.checks if check.checked_parts == CHECK)


def test_sizes_that_the_library_does_not_give_are_a_difference(
    equal_sizes: Explored, toycar: Workspace
) -> None:
    """Also if all errors of the plan agree: the message says which size, and what can be the reason."""
    _, run = equal_sizes
    [difference] = mutator.verify(run, workspace=toycar).differences
    assert difference.line == 1
    text = str(difference)
    assert "the library's fault sensor/distance/longer" in text
    assert " in the library, 0.001 in the plan" in text
    assert "either the library has changed since" in text and "or the plan was edited" in text


def test_faults_of_the_library_of_the_run_are_no_difference(
    equal_sizes: Explored, exploration: Explored
) -> None:
    """Of constant errors and challengers, whatever the library says."""
    for workspace, run in (equal_sizes, exploration):
        assert mutator.verify(run, workspace=workspace).differences == ()


def test_only_what_is_injected_is_compared(exploration: Explored, toycar: Workspace) -> None:
    """Another aim or text is no difference; another bound is one of each form; a spec that the library does
    not have, or no longer has, is named among the facts; a variant that it lost is a difference.
    """
    run, path = exploration[1], toycar.library / "faults" / "sensor" / "lane.yaml"
    text = path.read_text()

    def audit(*replaced: str) -> mutator.Audit:
        path.write_text(text.replace(*replaced))
        return mutator.verify(run, workspace=toycar)

    assert audit("aim: H3", "aim: H1").passed
    assert audit("The car thinks", "It thinks").passed
    bounded = library_check(audit("{by_m: offset}", "{by_m: offset, high_m: 9}"))
    assert len(bounded.differences) > 1
    assert {type(difference.line) for difference in bounded.differences} == {int}
    [lost, *_] = library_check(audit("  shifted:", "  moved:")).differences
    assert "no variant 'shifted'" in str(lost)
    path.unlink()
    without = mutator.verify(run, workspace=toycar)
    assert without.passed and without.facts["not in the library"] == "sensor/lane"
