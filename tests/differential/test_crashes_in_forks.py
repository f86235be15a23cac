"""A crash of a fork is judged without a second run only if that gives the reference engine's record."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutator.engines.crashes_in_forks import NEEDED_CONFIRMATIONS
from mutator.engines.engine_jobs import RunMode
from mutator.execution.experiment_runner import ExperimentRunner
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.model import Fault, Record
from mutator.workspace import Workspace

from .test_failure_cause import Blamed, at_gap, sensed

CONFIRMED = [RunMode.REFERENCE] * NEEDED_CONFIRMATIONS + [RunMode.FORK]


@pytest.fixture(scope="module")
def blamed(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Iterator[Blamed]:
    folder = tmp_path_factory.mktemp("crashes")
    made = Blamed(copy_toycar(folder), folder)
    yield made
    for engine in made.engines.values():
        engine.close()


def runs(blamed: Blamed, fault: Fault, count: int) -> tuple[list[RunMode | None], set[Record]]:
    """Run a fault several times on the fork engine; return how, and the different records."""
    experiment = blamed.experiment(fault)
    runner = ExperimentRunner(
        blamed.manifest,
        blamed.models,
        blamed.engines["fork"],
        LoadedGoldens(blamed.manifest, blamed.golden),
        blamed.toy.scenario,
    )
    finished = [next(iter(runner.run([experiment]))) for _ in range(count)]
    return [one.mode for one in finished], {one.record for one in finished}


@pytest.mark.parametrize("mood", [None, "fail", "be_silent"])
def test_after_three_confirmations_a_crash_is_judged_from_its_fork(blamed: Blamed, mood: str | None) -> None:
    modes, records = runs(blamed, sensed(mood), NEEDED_CONFIRMATIONS + 1)
    assert modes == CONFIRMED
    assert records == set(blamed.run("reference", [blamed.experiment(sensed(mood))]))


def test_an_injected_line_is_blamed_from_a_fork_too(blamed: Blamed) -> None:
    """The stack of a fork has the lines of the mutant."""
    for model in ("raising", "declared"):
        _, records = runs(blamed, at_gap(model), NEEDED_CONFIRMATIONS + 1)
        assert records == set(blamed.run("reference", [blamed.experiment(at_gap(model))]))
    assert runs(blamed, at_gap("declared"), 1)[0] == [RunMode.FORK]


@pytest.mark.parametrize("mood", ["leave", "recur", "want_too_much", "vanish", "break_down", "open_nothing"])
def test_the_reference_engine_always_runs_what_depends_on_the_process(blamed: Blamed, mood: str) -> None:
    """Exits, the depth of the stack, memory, signals, and errors of the system."""
    modes, records = runs(blamed, sensed(mood), NEEDED_CONFIRMATIONS + 1)
    assert modes == [RunMode.REFERENCE] * (NEEDED_CONFIRMATIONS + 1)
    assert len(records) == 1


def test_a_class_that_the_entry_module_catches_is_never_judged_from_a_fork(
    tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    """Only a fresh interpreter has the frames around the steps."""
    toy = copy_toycar(tmp_path)
    go = toy.library.parent / "tree" / "toycar" / "go.py"
    text, step = go.read_text(), "        drive.step()\n"
    assert text.count(step) == 1
    caught = f"        try:\n    {step}        except ValueError:\n            sys.exit(5)\n"
    go.write_text(text.replace(step, caught))
    blamed = Blamed(toy, tmp_path)
    try:
        modes, records = runs(blamed, sensed("fail"), NEEDED_CONFIRMATIONS + 1)
        assert set(modes) == {RunMode.REFERENCE}
        assert [record.detail.partition(" (")[0] for record in records] == ["exit status 5"]
        assert runs(blamed, sensed(None), NEEDED_CONFIRMATIONS + 1)[0] == CONFIRMED
    finally:
        for engine in blamed.engines.values():
            engine.close()
