"""Opening and owning the run folder."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mutator._common import folder_locks
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.store.run_deletion import delete_run
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

HOLDER = """
import sys, time
from pathlib import Path
from mutator._common import folder_locks
run = Path(sys.argv[1])
if sys.argv[2] == "owner":
    with folder_locks.lock_run_folder(run):
        print("held", flush=True)
        time.sleep(60)
else:
    folder_locks.open_worker_lock(run)
    print("held", flush=True)
    time.sleep(float(sys.argv[3]))
"""


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    return freeze_plan(build_plan(toycar, "toy"), tmp_path / "run", toycar)


def holder(folder: RunFolder, *words: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-c", HOLDER, str(folder.path), *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_provenance_lists_what_a_run_depends_on(folder: RunFolder, toycar: Workspace) -> None:
    found = folder.provenance
    assert found["mutator"]
    assert found["stretches"] == []
    assert found["sources"]["target"] == toycar.manifest("toycar").tree.digest
    assert {"templates", "manifest", "scenario A", "scenario B"} < set(found["sources"])
    assert (found["seed"], found["reading"]) == (7, "as_described")


def test_a_newer_schema_is_refused(folder: RunFolder) -> None:
    path = folder.path / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"schema": "run/4"}))
    with pytest.raises(MutatorError, match=r"run\.json: schema 'run/4'.*use a newer version of mutator"):
        RunFolder.open(folder.path)


def test_a_folder_that_is_not_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match="not a run folder"):
        RunFolder.open(tmp_path)


def test_a_unique_prefix_of_an_id_finds_the_experiment(folder: RunFolder) -> None:
    with pytest.raises(MutatorError, match="no experiment 'zz'"):
        folder.experiment_id_from("zz")
    with pytest.raises(MutatorError, match="24 experiments start with ''") as error:
        folder.experiment_id_from("")
    assert re.match("one of [0-9a-f]{8}, [0-9a-f]{8}, ", str(error.value.expected))


def test_a_run_folder_has_one_owner(folder: RunFolder) -> None:
    process = holder(folder, "owner")
    try:
        for attempt in (
            lambda: folder_locks.lock_run_folder(folder.path).__enter__(),
            lambda: delete_run(folder.path),
        ):
            with pytest.raises(MutatorError, match=f"in use by process {process.pid}"):
                attempt()
    finally:
        process.kill()
        process.communicate()
    with folder_locks.lock_run_folder(folder.path):
        assert (folder.path / "owner.lock").read_text().strip().isdigit()


def test_a_new_owner_waits_for_workers_of_a_dead_command(folder: RunFolder) -> None:
    process = holder(folder, "worker", "1")
    assert folder_locks.living_worker_pids(folder.path) == [process.pid]
    with pytest.raises(MutatorError, match=rf"workers of an earlier run .* {process.pid}\)"):
        folder_locks.lock_run_folder(folder.path, patience_s=0.2).__enter__()
    with folder_locks.lock_run_folder(folder.path):
        assert folder_locks.living_worker_pids(folder.path) == []
    process.communicate()


@pytest.mark.parametrize("name", ["owner.lock", "workers/1"])
def test_a_lock_that_is_not_a_file_is_refused(folder: RunFolder, name: str) -> None:
    place = folder.path / name
    place.unlink(missing_ok=True)
    place.parent.mkdir(exist_ok=True)
    os.mkfifo(place)
    with pytest.raises(MutatorError, match=rf"{name}: not a regular file"):
        folder_locks.lock_run_folder(folder.path).__enter__()
    place.unlink()
    place.mkdir(parents=True)
    with pytest.raises(MutatorError, match=rf"{name}: not a regular file"):
        folder_locks.lock_run_folder(folder.path).__enter__()
    place.rmdir()
    head = (folder.path / "run.json").read_bytes()
    place.symlink_to(folder.path / "run.json")
    with pytest.raises(MutatorError, match=rf"{name}: not a regular file"):
        folder_locks.lock_run_folder(folder.path).__enter__()
    assert (folder.path / "run.json").read_bytes() == head


def test_a_run_folder_without_its_plan_is_reported(folder: RunFolder) -> None:
    (folder.path / "plan" / "experiments.jsonl").unlink()
    with pytest.raises(MutatorError, match=r"experiments\.jsonl: cannot be read .*damaged"):
        folder.experiment_id_from("00")


@pytest.mark.parametrize("place", ["/proc/nosuch/run", "/dev/null/run"])
def test_a_folder_that_cannot_be_created_is_reported(toycar: Workspace, place: str) -> None:
    with pytest.raises(MutatorError, match="cannot be written"):
        freeze_plan(build_plan(toycar, "toy"), Path(place), toycar)
