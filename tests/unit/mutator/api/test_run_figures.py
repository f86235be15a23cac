"""The figures of a run in the Python API."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.api.runs import Run
from mutator.errors import MutatorError
from mutator.model import Experiment, ObservedActivation, Outcome
from mutator.workspace import Workspace


def became(e: Experiment) -> dict[str, Any]:
    active = {"activation": ObservedActivation(first=1.0, last=5.0, count=9)}
    if e.fault.fault_type == "silence":
        return active | {"outcome": Outcome.HAZARD, "hazards": (("H1", 4.0),)}
    return active


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Run:
    folder = tmp_path_factory.mktemp("figures")
    toycar = copy_toycar(folder)
    return mutator.load_run(write_run(toycar, folder / "first", became), workspace=toycar)


def fault_with_values(run: Run) -> str:
    results = run.results[run.results["value"].notna()]
    return f"{results['kind'].iloc[0]}/{results['variant'].iloc[0]}"


def test_a_fault_is_plotted_over_a_column_in_its_unit(run: Run) -> None:
    fault = fault_with_values(run)
    unit = run.results.loc[run.results["value"].notna(), "unit"].iloc[0]
    with pytest.raises(MutatorError, match=r"y: 'no_such'; expected one of .*time_to_hazard"):
        run.plot_values(fault, y="no_such")
    [axis] = run.plot_values(fault, y="time_to_hazard").axes
    assert axis.get_xlabel() == ("value" if unit == "-" else f"value [{unit}]")
    assert axis.get_ylabel() == "time to hazard [s]"


def test_an_unknown_fault_and_one_without_a_value_are_refused(run: Run) -> None:
    with pytest.raises(MutatorError, match="fault: 'sensor/none'; expected one of"):
        run.plot_values("sensor/none")
    values_by_kind = run.results.groupby("kind")["value"].count()
    without = values_by_kind.index[values_by_kind == 0]
    assert len(without)
    for kind in without:
        with pytest.raises(MutatorError, match="a fault with a single number as its value"):
            run.plot_values(kind)


def test_the_times_of_all_faults_and_of_one_are_plotted_and_shown_in_a_notebook(run: Run) -> None:
    kind = str(run.results.loc[run.results["hazard"], "kind"].iloc[0])
    figure: Any = run.plot_times_to_hazard(kind, reaction_time_s=3.0)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [label.partition(":")[0] for label in labels] == ["all faults", "this fault"]
    assert all("100.0 %" in label and label.endswith("within 3 s") for label in labels)
    assert figure._repr_png_().startswith(b"\x89PNG")
