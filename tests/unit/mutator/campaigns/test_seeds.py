"""Campaigns with several seeds."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.campaigns.plan import Plan, SeedBySeedPlan, build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.store import plan_file
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

SEEDS = "seeds: {from: 3, to: 5}"


@pytest.fixture
def campaign(toycar: Workspace, tmp_path: Path) -> Callable[..., Path]:
    def write(lines: str = SEEDS, **more: str) -> Path:
        text = toycar.campaign("small").read_text()
        assert "\nseed: 3\n" in text
        extra = "".join(f"{name}: {value}\n" for name, value in more.items())
        path = tmp_path / "small.yaml"
        path.write_text(text.replace("\nseed: 3\n", f"\n{lines}\n{extra}"))
        return path

    return write


def alone(workspace: Workspace, path: Path, seed: int, **chosen: int) -> Plan:
    return build_plan(workspace, path, Choices(seed=seed, **chosen))  # type: ignore[arg-type]


@pytest.mark.parametrize("more", [{}, {"sample": "4"}], ids=["all", "sample"])
def test_a_plan_for_several_seeds_joins_the_plans_for_each_seed(
    toycar: Workspace, campaign: Callable[..., Path], more: dict[str, str]
) -> None:
    path = campaign(**more)
    plan, parts = build_plan(toycar, path), [alone(toycar, path, seed) for seed in (3, 4, 5)]
    assert plan.experiments == tuple(e for part in parts for e in part.experiments)
    assert plan.chunks == tuple(n for part in parts for n in part.chunks)
    assert plan.runs == sum(part.runs for part in parts)
    assert len({e.id for e in plan.experiments}) == len(plan.experiments)
    assert parts[0].experiments == build_plan(toycar, campaign("seed: 3", **more)).experiments
    assert parts[0].digest == build_plan(toycar, path).digest


def test_a_limit_is_spread_over_the_seeds(toycar: Workspace, campaign: Callable[..., Path]) -> None:
    plan = build_plan(toycar, campaign(), Choices(limit=7))
    assert [sum(e.seed == seed for e in plan.experiments) for seed in (3, 4, 5)] == [3, 2, 2]
    assert {e.seed for e in build_plan(toycar, campaign(), Choices(limit=2)).experiments} == {3, 4}


def test_a_filter_can_leave_a_seed_without_experiments(
    toycar: Workspace, campaign: Callable[..., Path]
) -> None:
    plan = build_plan(toycar, campaign(), Choices(only="seed == 4"))
    assert plan.experiments == alone(toycar, campaign(), 4).experiments
    with pytest.raises(MutatorError, match="no experiment is left"):
        build_plan(toycar, campaign(), Choices(only="seed == 9"))


def test_each_seed_has_its_own_golden_runs(
    toycar: Workspace, campaign: Callable[..., Path], tmp_path: Path
) -> None:
    """Even a run without a fault uses the seed."""
    folder = freeze_plan(SeedBySeedPlan(toycar, campaign()), tmp_path / "run", toycar)
    assert folder.seeds == range(3, 6)
    keys = {one.key for one in folder.golden_runs}
    assert {"A@3", "A@4", "A@5"} <= keys
    assert {folder.golden_folder_of(e).name for e in plan_file.load_experiments(folder.path)} <= keys


def test_a_plan_written_in_parts_equals_the_one_in_memory(
    toycar: Workspace, campaign: Callable[..., Path], tmp_path: Path
) -> None:
    path = campaign()
    parts, whole = tmp_path / "parts", tmp_path / "whole"
    freeze_plan(SeedBySeedPlan(toycar, path), parts, toycar)
    freeze_plan(build_plan(toycar, path), whole, toycar)
    names = sorted(one.relative_to(whole) for one in whole.rglob("*") if one.name != "owner.lock")
    assert names == sorted(one.relative_to(parts) for one in parts.rglob("*") if one.name != "owner.lock")
    files = [name for name in names if (whole / name).is_file()]
    assert [(parts / name).read_bytes() for name in files] == [(whole / name).read_bytes() for name in files]
    plan = build_plan(toycar, path)
    read = load_plan(RunFolder.open(parts))
    assert read.experiments == plan.experiments
    assert (read.tally, read.goldens()) == (plan.tally, plan.goldens())


def test_planned_experiments_can_be_read_by_position(
    toycar: Workspace, campaign: Callable[..., Path], tmp_path: Path
) -> None:
    folder = freeze_plan(SeedBySeedPlan(toycar, campaign()), tmp_path / "run", toycar)
    planned = plan_file.ExperimentsReadOnAccess(folder.path, folder.head.chunks)
    every = plan_file.load_experiments(folder.path)
    assert (len(planned), tuple(planned)) == (len(every), every)
    assert [planned[i] for i in range(-3, len(every))] == [every[i] for i in range(-3, len(every))]
    assert planned[2:5] == list(every[2:5])
    with pytest.raises(IndexError):
        planned[len(every)]


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("about_seeds: 3", "either `seed` or `seeds`|unknown"),
        ("seed: 3\nseeds: {from: 3, to: 5}", "`seed` or `seeds`, not both"),
        ("seeds: {from: 5, to: 3}", "`to` between 5 and 10004"),
        ("seeds: {from: 1, to: 10001}", "`to` between 1 and 10000"),
        ("seeds: {from: -1, to: 3}", "from"),
        ("seeds: {from: 1}", "to"),
        ("seeds: 3", "seeds"),
    ],
)
def test_invalid_seeds_are_reported_with_their_line(
    toycar: Workspace, campaign: Callable[..., Path], lines: str, said: str
) -> None:
    with pytest.raises(MutatorError) as told:
        build_plan(toycar, campaign(lines))
    assert re.search(said, str(told.value)) and "small.yaml:" in str(told.value)
