"""Shards that are run separately and then merged equal a single run."""

import json
import shutil
from collections.abc import Callable
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import pytest

from mutator.audit.run_digests_and_seal import seals_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import CheckFailed, MutatorError
from mutator.execution import shard_merging
from mutator.execution.campaign_running import run_campaign
from mutator.execution.shard_merging import merge_shards
from mutator.results import table_building
from mutator.store import recorded_approvals
from mutator.store.packed_patches import PatchFolder
from mutator.store.plan_choices import Choices
from mutator.store.records import load_records
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

Runs = dict[str, Path]
Reseal = Callable[..., None]
DERIVED = ("results.csv", "results.parquet", "propagation.parquet", "plan.csv", "plan/experiments.jsonl")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Runs:
    folder = tmp_path_factory.mktemp("shards")
    toy = copy_toycar(folder)
    made = {"whole": folder / "whole", "1/2": folder / "one", "2/2": folder / "two"}
    for shard, out in made.items():
        choices = Choices(shard=None if shard == "whole" else shard)
        summary = run_campaign(toy, "small", out, choices=choices)
        assert summary.exit_code == 0
        assert summary.done == summary.planned == RunFolder.open(out).planned_experiment_count
    return made


@pytest.fixture
def copies(runs: Runs, tmp_path: Path) -> Runs:
    return {name: Path(shutil.copytree(path, tmp_path / path.name)) for name, path in runs.items()}


def change_head(run: Path, **values: object) -> None:
    head = json.loads((run / "run.json").read_text())
    (run / "run.json").write_text(json.dumps(head | values))


def test_merged_shards_equal_the_single_run(runs: Runs, tmp_path: Path) -> None:
    merge_shards([runs["2/2"], runs["1/2"]], tmp_path / "out")
    for name in DERIVED:
        assert (tmp_path / "out" / name).read_bytes() == (runs["whole"] / name).read_bytes()
    merged, whole = (
        {name: found.read_patch(name) for name in found}
        for found in map(PatchFolder, (tmp_path / "out", runs["whole"]))
    )
    assert merged == whole and None not in merged.values()
    series = [
        {path.name: path.read_bytes() for path in (run / "series").iterdir()}
        for run in (tmp_path / "out", runs["whole"])
    ]
    assert series[0] == series[1] and len(series[0]) == 3
    heads = [json.loads((run / "run.json").read_text()) for run in (tmp_path / "out", runs["whole"])]
    stretches = [head.pop("stretches") for head in heads]
    assert heads[0] == heads[1]
    same = [{k: v for k, v in stretch.items() if k != "records"} for stretch in chain(*stretches)]
    assert len(stretches[0]) == 2 and same == [same[0]] * 3


def test_a_killed_merge_loses_no_series(runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing could rebuild the series of a merged run folder."""
    seen: list[int] = []

    def build(run: Path) -> Path:
        seen.append(len(list((run / "series").iterdir())))
        return table_building.build_tables(run)

    monkeypatch.setattr(shard_merging, "table_building", SimpleNamespace(build_tables=build))
    merge_shards([runs["1/2"], runs["2/2"]], tmp_path / "out")
    assert seen == [3]


def test_merged_shards_have_the_seal_of_the_single_run(runs: Runs, tmp_path: Path) -> None:
    merge_shards([runs["2/2"], runs["1/2"]], tmp_path / "out")
    seals = [seals_of(RunFolder.open(path)).seal for path in (runs["whole"], tmp_path / "out", runs["1/2"])]
    assert seals[0] is not None and seals[0] == seals[1] != seals[2]


def test_an_approval_is_merged_if_every_shard_has_it(copies: Runs, tmp_path: Path) -> None:
    said = {
        "schema": recorded_approvals.APPROVALS_SCHEMA,
        "target": "toycar",
        "groups": [{"group": "0" * 12, "by": "Jane Doe"}],
    }
    shards = [copies["1/2"], copies["2/2"]]
    recorded_approvals.write_approvals(shards[0], said)
    merge_shards(shards, tmp_path / "half")
    assert recorded_approvals.approval_summary(tmp_path / "half") == ""
    recorded_approvals.write_approvals(shards[1], said)
    merge_shards(shards, tmp_path / "out")
    assert recorded_approvals.approval_summary(tmp_path / "out") == "1 group approved by Jane Doe (1)"


def test_each_experiment_is_in_exactly_one_shard(runs: Runs) -> None:
    one, two, whole = (set(load_records(runs[name])) for name in ("1/2", "2/2", "whole"))
    assert not one & two
    assert one | two == whole
    assert len({RunFolder.open(path).head.plan for path in runs.values()}) == 1


def test_a_shard_resumes_without_its_option(copies: Runs, toy: Workspace) -> None:
    summary = run_campaign(toy, "small", copies["1/2"])
    assert (summary.ran, summary.done) == (0, RunFolder.open(copies["1/2"]).planned_experiment_count)
    with pytest.raises(MutatorError, match="shard 2/2"):
        run_campaign(toy, "small", copies["1/2"], choices=Choices(shard="2/2"))


def test_nothing_is_left_to_run_in_a_merged_folder(runs: Runs, toy: Workspace, tmp_path: Path) -> None:
    merge_shards([runs["1/2"], runs["2/2"]], tmp_path / "out")
    summary = run_campaign(toy, "small", tmp_path / "out")
    assert (summary.exit_code, summary.ran, summary.done) == (0, 0, 12)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("1/2",), "no folder for shard 2/2"),
        (("1/2", "1/2"), "shard 1/2 is given twice"),
        (("1/2", "whole"), "a whole run, not a shard"),
    ],
)
def test_missing_duplicate_and_whole_shards_are_refused(
    runs: Runs, tmp_path: Path, given: tuple[str, ...], told: str
) -> None:
    with pytest.raises(MutatorError, match=told):
        merge_shards([runs[name] for name in given], tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_shards_of_other_plans_or_sources_are_refused(
    copies: Runs, toy: Workspace, tmp_path: Path, reseal: Reseal
) -> None:
    two = copies["2/2"]
    head = json.loads((two / "run.json").read_text())
    for change, told in (
        ({"plan": "0" * 64}, "expected 0000000000000000"),
        ({"sources": head["sources"] | {"target": "0" * 64}}, "a different source"),
        ({"alerts": ["A9"]}, "'alerts' differs from"),
    ):
        change_head(two, **head | change)
        reseal(two)
        with pytest.raises(MutatorError, match=told) as caught:
            merge_shards([copies["1/2"], two], tmp_path / "out")
        assert str(two) in str(caught.value)
    third = freeze_plan(build_plan(toy, "small", Choices(shard="2/3")), tmp_path / "third", toy).path
    with pytest.raises(MutatorError, match=f"{third}: shard 2/3; expected one of 2 shards"):
        merge_shards([copies["1/2"], third], tmp_path / "out")


def test_an_unfinished_or_foreign_shard_is_refused(copies: Runs, tmp_path: Path, reseal: Reseal) -> None:
    one, two = copies["1/2"], copies["2/2"]
    path = next((one / "records").iterdir())
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]))
    reseal(one, finished=False)
    with pytest.raises(MutatorError, match=f"unfinished: {len(lines) - 2} of {len(lines) - 1}"):
        merge_shards([one, two], tmp_path / "out")
    path.write_bytes(b"".join(lines))
    reseal(one, finished=True)
    shutil.copy(path, two / "records" / "0009-main.jsonl")
    reseal(two)
    with pytest.raises(MutatorError, match=r"0009-main\.jsonl:2: a record of .*, which is not planned"):
        merge_shards([one, two], tmp_path / "out")


def test_shards_with_different_golden_runs_are_refused(copies: Runs, tmp_path: Path, reseal: Reseal) -> None:
    path = copies["2/2"] / "checks.json"
    checks = json.loads(path.read_text())
    path.write_text(json.dumps(checks | {"goldens": {"A": "0" * 64}}))
    reseal(copies["2/2"])
    with pytest.raises(CheckFailed, match="golden run A"):
        merge_shards([copies["1/2"], copies["2/2"]], tmp_path / "out")


@pytest.mark.parametrize("broken", ["1/2", "2/2"])
def test_a_shard_with_a_failed_equivalence_check_is_refused(
    copies: Runs, tmp_path: Path, broken: str, reseal: Reseal
) -> None:
    for path in (copies["1/2"], copies["2/2"]):
        shutil.rmtree(path / "proof")
        shutil.copytree(path / "records", path / "proof")
        reseal(path)
    path = next((copies[broken] / "proof").iterdir())
    head, first, *rest = path.read_text().splitlines()
    wrong = json.loads(first) | {"trace_digest": "0" * 64}
    path.write_text("\n".join([head, json.dumps(wrong), *rest, ""]))
    reseal(copies[broken])
    with pytest.raises(CheckFailed, match=f"experiment {wrong['experiment_id']} differs on") as caught:
        merge_shards([copies["1/2"], copies["2/2"]], tmp_path / "out")
    assert str(copies[broken]) in str(caught.value)
    assert not (tmp_path / "out").exists()
    path.write_text("\n".join([head, first, *rest, ""]))
    reseal(copies[broken])
    assert merge_shards([copies["1/2"], copies["2/2"]], tmp_path / "out").is_file()


def test_shards_are_not_merged_into_a_folder_with_a_run(runs: Runs, tmp_path: Path) -> None:
    before = (runs["whole"] / "results.csv").read_bytes()
    with pytest.raises(MutatorError, match="holds a run"):
        merge_shards([runs["1/2"], runs["2/2"]], runs["whole"])
    assert (runs["whole"] / "results.csv").read_bytes() == before


def test_the_same_command_completes_a_killed_merge(runs: Runs, tmp_path: Path) -> None:
    out, shards = tmp_path / "out", [runs["1/2"], runs["2/2"]]
    for name in (".run.json.1", "owner.lock", "golden/A/log.npz", "records/0001-a.jsonl", "thesis.tex"):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).touch()
    with pytest.raises(MutatorError, match=r"not empty \(thesis\.tex\)"):
        merge_shards(shards, out)
    (out / "thesis.tex").unlink()
    (out / ".run.json.1").touch()
    (out / "records").mkdir()
    merge_shards(shards, out)
    assert seals_of(RunFolder.open(out)).seal == seals_of(RunFolder.open(runs["whole"])).seal
    assert not list(out.glob(".*"))


def test_a_failed_merge_leaves_nothing_and_can_be_repeated(
    runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch, pytest.raises(RuntimeError):
        patch.setattr("mutator.results.table_building.build_tables", fail)
        merge_shards([runs["1/2"], runs["2/2"]], tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert merge_shards([runs["1/2"], runs["2/2"]], tmp_path / "out").is_file()


def fail(run: Path) -> Path:
    raise RuntimeError


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "1/0", "-1/3", "1/7"])
def test_impossible_shards_are_refused(toy: Workspace, shard: str) -> None:
    with pytest.raises(MutatorError, match=f"shard:? '?{shard}"):
        build_plan(toy, "small", Choices(shard=shard))


@pytest.mark.slow
def test_merged_shards_of_the_shipped_controller_equal_its_single_run(tmp_path: Path) -> None:
    clone = Workspace.find(root=Path(__file__).parents[2])

    def ran(name: str, workers: int, shard: str | None = None) -> Path:
        choices = Choices(limit=40, shard=shard)
        summary = run_campaign(clone, "paper_reference", tmp_path / name, workers=workers, choices=choices)
        assert summary.exit_code == 0
        return tmp_path / name

    one, two = ran("one", 1), ran("two", 2)
    shards = [ran(f"shard{k}", 2, f"{k}/3") for k in (1, 2, 3)]
    merge_shards(shards, tmp_path / "merged")
    assert len((one / "results.csv").read_text().splitlines()) == 1 + 40
    assert sum(RunFolder.open(shard).planned_experiment_count for shard in shards) == 40
    for name in DERIVED:
        whole = (one / name).read_bytes()
        assert (two / name).read_bytes() == whole
        assert (tmp_path / "merged" / name).read_bytes() == whole
