"""Build mutants without running them."""

import csv
import subprocess
from pathlib import Path

import pytest

import mutator
from mutator.api.mutant_files import pairs_of_campaign, pairs_of_specs, write_mutants
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.errors import MutatorError
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


def test_a_mutant_has_a_diff_a_patch_and_files(toycar: Workspace, tmp_path: Path) -> None:
    mutant = mutator.build_mutant("sensor/distance/longer", "near", value=12.5, workspace=toycar)
    assert "gap = gap + 12.5" in mutant.diff
    assert set(mutant.files) == {"toycar/_fi.py", "toycar/go.py", "toycar/sensing.py"}
    tree = mutant.write(tmp_path / "tree")
    subprocess.run(["patch", "-R", "-p1", "-s"], input=mutant.patch.encode(), cwd=tree, check=True)
    for name in ("go.py", "sensing.py"):
        original = toycar.library.parent / "tree" / "toycar" / name
        assert (tree / "toycar" / name).read_bytes() == original.read_bytes()
    with pytest.raises(MutatorError, match="not empty"):
        mutant.write(tree)


def test_the_name_and_the_record_of_a_fault_give_the_same_mutant(toycar: Workspace) -> None:
    [fault, *_] = toycar.faults("sensor/distance/longer")
    by_record = mutator.build_mutant(fault, "near", workspace=toycar)
    assert isinstance(fault.value, int)
    by_name = mutator.build_mutant("sensor/distance/longer", "near", value=fault.value, workspace=toycar)
    assert by_name.id == by_record.id
    assert mutator.build_mutant(fault, by_name.trigger, workspace=toycar).patch == by_name.patch
    assert mutator.build_mutant(fault, "far", workspace=toycar).id != by_name.id
    assert by_name.fault.label in repr(by_name)
    assert "sensing.py" in by_name._repr_html_()


def test_mutants_of_a_campaign_are_written(toycar: Workspace, tmp_path: Path) -> None:
    steps: list[int] = []
    bench, pairs = pairs_of_campaign(toycar, "small", Choices(limit=4))
    index = write_mutants(bench, pairs, tmp_path / "m", step=lambda: steps.append(1))
    assert len(steps) == len(pairs) == 4
    with (tmp_path / "m" / "index.csv").open(newline="") as file:
        assert list(csv.DictReader(file)) == index
    assert all((tmp_path / "m" / line["patch"]).is_file() for line in index)


@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize("error", [MutatorError("no"), KeyboardInterrupt()])
def test_nothing_stays_of_mutants_that_are_written_in_part(
    toycar: Workspace, tmp_path: Path, exists: bool, error: BaseException
) -> None:
    bench, pairs = pairs_of_campaign(toycar, "small", Choices(limit=4))
    out, steps = tmp_path / "m", [None, error]
    if exists:
        out.mkdir()

    def step() -> None:
        if problem := steps.pop(0):
            raise problem

    with pytest.raises(type(error)):
        write_mutants(bench, pairs, out, trees=True, step=step)
    assert [*out.iterdir()] == [] if exists else not out.exists()


def test_specs_are_paired_with_every_context(toycar: Workspace) -> None:
    bench = SelectedTarget.of(toycar)
    pairs = pairs_of_specs(bench, ["sensor/lane"])
    assert {trigger.name for _, trigger in pairs} == {"near", "far"}
    with pytest.raises(MutatorError, match="no spec matches 'nothing"):
        pairs_of_specs(bench, ["nothing*"])
