"""Ten forgeries of a finished run, with stale digests and with recomputed ones. Every reader finds the first
kind. Only the seal reveals the second."""

import json
import re
import shutil
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator._common.hashing import canonical_json, digest
from mutator.audit.run_digests_and_seal import golden_digests, seals_of
from mutator.campaigns.plan import load_plan
from mutator.campaigns.plan_freezing import plan_csv_bytes
from mutator.campaigns.plan_tally import plan_digest
from mutator.cli.app import main
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.model import Experiment
from mutator.results import table_building
from mutator.store import plan_file
from mutator.store.packed_patches import PatchFolder
from mutator.store.packed_patches import rewrite_patch_file as rewrite_patches
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.made_up_results import edit_results

CLONE = Path(__file__).parents[2]
Reseal = Callable[..., None]


@pytest.fixture(
    scope="module",
    params=["toy", pytest.param("paper_smoke", marks=pytest.mark.slow)],
)
def genuine(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
) -> tuple[Workspace, Path]:
    place = tmp_path_factory.mktemp("genuine")
    is_toy = request.param == "toy"
    workspace = copy_toycar(place) if is_toy else Workspace.find(root=CLONE)
    campaign = "small" if is_toy else request.param
    summary = run_campaign(workspace, campaign, place / "run", workers=0 if is_toy else 2, engine="fork")
    assert summary.exit_code == 0 and summary.proof is not None
    return workspace, place / "run"


@pytest.fixture
def run(genuine: tuple[Workspace, Path], tmp_path: Path) -> Path:
    """A copy of the run to forge. It has a plot, so `show` runs nothing."""
    return Path(shutil.copytree(genuine[1], tmp_path / "run"))


def hazardous(run: Path) -> tuple[Path, int, dict[str, Any]]:
    for path in sorted((run / "records").iterdir()):
        for place, line in enumerate(path.read_text().splitlines()):
            record = json.loads(line)
            if record.get("outcome") == "hazard":
                return path, place, record
    raise AssertionError("the run has no hazard")


def rewrite(path: Path, place: int, *lines: str) -> None:
    old = path.read_text().splitlines()
    path.write_text("".join(f"{line}\n" for line in [*old[:place], *lines, *old[place + 1 :]]))


def change(run: Path, **values: Any) -> str:
    path, place, record = hazardous(run)
    rewrite(path, place, canonical_json(record | values))
    return str(record["experiment_id"])


# Forgeries that are possible in a text editor. With `deep`, all digests and ids match, except those that
# `reseal` computes.


def an_outcome(run: Path, deep: bool) -> None:
    fields = {"outcome": "masked"}
    change(run, **(fields | {"hazards": [], "t_manifest": None} if deep else fields))


def a_time(run: Path, deep: bool) -> None:
    _, _, record = hazardous(run)
    [name, time], *others = record["hazards"]
    change(run, hazards=[[name, time - 0.05], *others])


def a_patch(run: Path, deep: bool) -> None:
    _, _, record = hazardous(run)
    name = record["experiment_id"]
    forged = (PatchFolder(run).read_patch(name) or b"").replace(b"# fi:", b"# by hand fi:", 1)
    put_patch(run, name, forged)
    if deep:
        change(run, patch=digest(forged))


def put_patch(run: Path, name: str, data: bytes) -> None:
    found = PatchFolder(run)
    path = (
        found.expected_file_of(name) if name in set(found) else found.block_files()[0]
    )  # each worker has one
    kept = {other: found.read_patch(other) or b"" for other in found if found.expected_file_of(other) == path}
    patches = kept | {name: data}
    rewrite_patches(path, patches.items())


def a_golden_trace(run: Path, deep: bool) -> None:
    folder = RunFolder.open_unverified(run)
    scenario, changes = folder.head.goldens[0]
    path = folder.golden_folder(scenario, tuple(changes)) / folder.head.golden_files[0]
    path.write_bytes(path.read_bytes()[:-1] + b"x")
    if deep:
        checks = json.loads((run / "checks.json").read_text())
        checks["goldens"] = golden_digests(folder, folder.head.golden_files)
        (run / "checks.json").write_text(json.dumps(checks))


def a_dropped_record(run: Path, deep: bool) -> None:
    path, place, record = hazardous(run)
    rewrite(path, place)
    if deep:
        drop_from_plan(run, record["experiment_id"])


def drop_from_plan(run: Path, name: str) -> None:
    for path in (run / "proof").iterdir():
        kept = [line for line in path.read_text().splitlines() if name not in line]
        path.write_text("".join(f"{line}\n" for line in kept))
    replan(run, lambda experiments: [e for e in experiments if e.id != name])


def an_added_record(run: Path, deep: bool) -> None:
    path, place, record = hazardous(run)
    added = record | {"experiment_id": "0123456789abcdef"}
    if deep:
        twin = next(e for e in plan_file.load_experiments(run) if e.id == record["experiment_id"])
        twin = replace(twin, seed=twin.seed + 1)
        added = record | {"experiment_id": twin.id}
        replan(run, lambda experiments: [*experiments, twin])
        copy_patch(run, record["experiment_id"], twin.id)
    rewrite(path, place, canonical_json(record), canonical_json(added))


def copy_patch(run: Path, name: str, other: str) -> None:
    put_patch(run, other, PatchFolder(run).read_patch(name) or b"")


def a_plan_condition(run: Path, deep: bool) -> None:
    _, _, record = hazardous(run)
    name = record["experiment_id"]
    old = next(e for e in plan_file.load_experiments(run) if e.id == name)
    new = replace(old, trigger=replace(old.trigger, armed_after_s=old.trigger.armed_after_s + 1.0))
    path = run / plan_file.EXPERIMENTS_FILE
    if not deep:
        one = canonical_json(plan_file.experiment_as_json(old))
        assert one in path.read_text()
        path.write_text(
            path.read_text().replace(one, canonical_json(plan_file.experiment_as_json(new) | {"id": name}))
        )
        return
    copy_patch(run, name, new.id)
    for file in (*(run / "records").iterdir(), *(run / "proof").iterdir()):
        file.write_text(file.read_text().replace(name, new.id))
    replan(run, lambda experiments: [new if e.id == name else e for e in experiments])


def replan(run: Path, changed: Callable[[list[Experiment]], list[Experiment]]) -> None:
    plan = load_plan(RunFolder.open_unverified(run))
    old = list(plan.experiments)
    new = tuple(changed(old))
    sizes = [*plan.chunks[:-1], plan.chunks[-1] + len(new) - len(old)]
    sizes = sizes if sizes[-1] else sizes[:-1]
    chunks = plan_file.write_plan(run, new, sizes)
    path = run / "run.json"
    head = json.loads(path.read_text())
    head |= {"chunks": chunks, "experiments": len(new)}
    before = head["plan"]
    head["plan"] = plan_digest([e.id for e in new], sizes, plan.canary.id, plan.campaign)
    path.write_text(json.dumps(head))
    (run / "plan.csv").write_bytes(plan_csv_bytes(replace(plan, experiments=new)))
    for file in (file for kind in ("records", "proof", "timings") for file in (run / kind).iterdir()):
        file.write_text(file.read_text().replace(before, head["plan"]))


def a_version(run: Path, deep: bool) -> None:
    path = run / "run.json"
    path.write_text(re.sub(r'"numpy": "[^"]*"', '"numpy": "1.0.0"', path.read_text()))


def a_proof_entry(run: Path, deep: bool) -> None:
    path = next((run / "proof").iterdir())
    record = json.loads(path.read_text().splitlines()[1])
    wrong = {"trace_digest": "0" * 64}
    rewrite(path, 1, canonical_json(record | wrong))
    if deep:
        for file in (run / "records").iterdir():
            for place, line in enumerate(file.read_text().splitlines()):
                if json.loads(line).get("experiment_id") == record["experiment_id"]:
                    rewrite(file, place, canonical_json(json.loads(line) | wrong))


def the_table(run: Path, deep: bool) -> None:
    edit_results(run, "hazard", "masked")
    if deep:
        stamp = json.loads((run / "results.json").read_text())
        for name in ("results.csv", "results.parquet"):
            stamp["tables"][name] = digest((run / name).read_bytes())
        (run / "results.json").write_text(json.dumps(stamp))


FORGERIES = (
    an_outcome,
    a_time,
    a_patch,
    a_golden_trace,
    a_dropped_record,
    an_added_record,
    a_plan_condition,
    a_version,
    a_proof_entry,
    the_table,
)
forged = pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)


@pytest.fixture
def cli(
    genuine: tuple[Workspace, Path], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    monkeypatch.setenv("MUTATOR_ROOT", str(genuine[0].library.parent))

    def answer(*words: object) -> tuple[int, str]:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return code, capfd.readouterr().err

    return answer


Cli = Callable[..., tuple[int, str]]
EDITED = "results.csv: the table did not match the plan and records, so it was rebuilt"


def readers(run: Path, genuine: Path) -> dict[str, tuple[object, ...]]:
    campaign = RunFolder.open_unverified(genuine).head.campaign
    name = hazardous(genuine)[2]["experiment_id"]
    out = run.parent
    return {
        "run": ("run", campaign, "--out", run, "-n", "0"),
        "report": ("report", run),
        "show": ("show", name, "--run", run, "--no-plot"),
        "rerun": ("rerun", name, "--run", run),
        "compare": ("compare", genuine, run, "--out", out / "compared"),
        "merge": ("merge", run, run, "--out", out / "merged"),
        "csv": ("export", run, "--format", "csv", "--out", out / "a.csv"),
        "junit": ("export", run, "--format", "junit", "--out", out / "a.xml"),
        "verify": ("verify", run),
    }


# Commands that do not read the table.
BLIND = {the_table: ("show", "rerun", "compare", "merge")}


@forged
def test_every_reader_finds_a_plain_forgery(
    genuine: tuple[Workspace, Path], run: Path, cli: Cli, forge: Callable[[Path, bool], None]
) -> None:
    forge(run, False)
    for reader, words in readers(run, genuine[1]).items():
        if reader in BLIND.get(forge, ()):
            continue
        code, said = cli(*words)
        assert "Traceback" not in said and "defect" not in said
        if forge is the_table and reader != "verify":
            assert (code, EDITED in said) == (0, True), (reader, said)
            forge(run, False)
        else:
            assert (code in (1, 2) and str(run) in said) or reader == "verify", (reader, code, said)
            assert code != 0, reader


@forged
def test_the_api_finds_a_plain_forgery(
    genuine: tuple[Workspace, Path], run: Path, forge: Callable[[Path, bool], None]
) -> None:
    name = hazardous(genuine[1])[2]["experiment_id"]
    forge(run, False)
    if forge is the_table:
        with pytest.warns(mutator.MutatorWarning, match=EDITED):
            frame = mutator.load_run(run).results
        assert frame.equals(mutator.load_run(genuine[1]).results)
        return
    with pytest.raises(MutatorError):
        _ = mutator.load_run(run, workspace=genuine[0]).experiment(name).patch
    with pytest.raises(MutatorError):
        mutator.run(RunFolder.open_unverified(run).head.campaign, run, workspace=genuine[0]).report()


def test_the_genuine_run_passes(genuine: tuple[Workspace, Path], run: Path, cli: Cli, tmp_path: Path) -> None:
    known = seals_of(RunFolder.open(genuine[1])).seal
    for path in [run, *run.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        assert cli("verify", run, "--expect", known, "--rerun", "1") == (0, "")
    finally:
        for path in [run, *run.rglob("*")]:
            path.chmod(0o755 if path.is_dir() else 0o644)


@forged
def test_the_seal_reveals_a_forgery_with_consistent_digests(
    genuine: tuple[Workspace, Path],
    run: Path,
    reseal: Reseal,
    capfd: pytest.CaptureFixture[str],
    cli: Cli,
    forge: Callable[[Path, bool], None],
) -> None:
    """An edited table does not change the seal, but it does not match the records."""
    known = seals_of(RunFolder.open(genuine[1])).seal
    forge(run, True)
    if forge is not the_table:
        reseal(run)
        for name in (table_building.STAMP_FILE, table_building.CSV_FILE, table_building.PARQUET_FILE):
            (run / name).unlink()
        table_building.ensure_tables(run)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert RunFolder.open(run).is_finished
        table_building.ensure_tables(run)
    found = mutator.verify(run, expect=known, workspace=genuine[0])
    assert not found.passed
    assert (found.seal == known) == (forge is the_table)
    assert cli("verify", run, "--expect", known)[0] == 1
