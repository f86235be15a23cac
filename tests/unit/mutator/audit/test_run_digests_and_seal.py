"""The seal covers exactly the parts of a run that determine its result."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.hashing import canonical_json
from mutator.audit.run_digests_and_seal import digests_or_why_no_seal, seals_of, unsealed_facts
from mutator.store import file_digests
from mutator.store.checksummed_lines import line_file_bytes
from mutator.store.recorded_approvals import write_approvals
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

Reseal = Callable[..., None]


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_finished: Callable[..., Path],
) -> Path:
    place = tmp_path_factory.mktemp("sealed")
    return write_finished(copy_toycar(place), place / "run")


@pytest.fixture
def run(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "another place"))


def sealed(run: Path) -> str | None:
    return seals_of(RunFolder.open_unverified(run)).seal


def test_the_seal_does_not_depend_on_workers_or_order(made: Path, run: Path, reseal: Reseal) -> None:
    path = run / "records" / "0001-a.jsonl"
    head, *lines = path.read_text().splitlines()
    path.write_text("\n".join([head, *lines[12:], ""]))
    (path.with_name("0007-gw9.jsonl")).write_text("\n".join([head, *reversed(lines[:12]), ""]))
    shutil.rmtree(run / "timings")
    data = json.loads((run / "run.json").read_text())
    [stretch] = data["stretches"]
    data["choices"]["series_mb"] = 3
    data["stretches"] = [stretch, stretch | {"platform": "Linux on another one", "cpu": "Cray 1"}]
    (run / "run.json").write_text(json.dumps(data))
    edit(run / "checks.json", "{", '{"digest": "of another machine", "run_cpu_s": 3.5, ')
    reseal(run)
    known = sealed(made)
    assert known is not None and len(known) == 64
    assert sealed(run) == known


def test_a_retried_harness_error_does_not_affect_the_seal(made: Path, run: Path) -> None:
    folder = RunFolder.open(run)
    name = next(iter(folder.planned_positions()))
    head = {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
    path = run / "records" / "0002-a.jsonl"
    file_digests.add_segments_to_ledger(run, finished=False)
    path.write_bytes(line_file_bytes(path, head, [{"experiment_id": name, "status": "harness_error"}]))
    file_digests.add_segments_to_ledger(run, finished=True)
    assert sealed(run) == sealed(made)


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def add(run: Path, name: str) -> None:
    (run / name).write_bytes(b"more")
    ledger = file_digests.load_ledger(run)
    file_digests.save_ledger(
        run, replace(ledger, files={**ledger.files, name: file_digests.FileDigest.of_bytes(b"more")})
    )


def rename(run: Path, name: str, other: str) -> None:
    (run / name).rename(run / other)
    ledger = file_digests.load_ledger(run)
    files = {other if key == name else key: one for key, one in ledger.files.items()}
    file_digests.save_ledger(run, replace(ledger, files=files))


CHANGES: dict[str, Callable[[Path], None]] = {
    "a record": lambda run: edit(run / "records" / "0001-a.jsonl", '"count":5', '"count":6'),
    "a patch": lambda run: edit(run / "records" / "0001-a.jsonl", '"patch":"', '"patch":"0'),
    "a line of the plan": lambda run: edit(run / "plan" / "experiments.jsonl", '{"', '{ "'),
    "an unused fault": lambda run: edit(run / "plan" / "faults.jsonl", "{", "{}\n{"),
    "the campaign's text": lambda run: edit(run / "campaign.yaml", "schema", "# no\nschema"),
    "the table of the plan": lambda run: edit(run / "plan.csv", ",as_", ",not_as_"),
    "the proof": lambda run: edit(run / "proof" / "0001-a.jsonl", '"count":5', '"count":6'),
    "a golden run": lambda run: (run / "golden" / "A" / "log.npz").write_bytes(b"other"),
    "another file of a golden run": lambda run: add(run, "golden/A/more.txt"),
    "the name of a golden run's file": lambda run: rename(run, "golden/A/log.npz", "golden/A/other.npz"),
    "the checked golden runs": lambda run: edit(run / "checks.json", '"goldens": {', '"goldens": {"A": "0"'),
    "a key of the checks": lambda run: edit(run / "checks.json", "{", '{"packages": ["numpy"], '),
    "a key that a later version writes": lambda run: edit(run / "run.json", "{", '{"later": 1, '),
    "an alert": lambda run: edit(run / "run.json", '"alerts": [', '"alerts": [\n"A9",'),
    "the severity": lambda run: edit(
        run / "run.json",
        '"severity": null',
        '"severity": {"name": "s", "about": "", "source": "", "classes": [["S0", 0, ""]]}',
    ),
    "a hazard's text": lambda run: edit(run / "run.json", '"about": "', '"about": "not '),
    "a limit": lambda run: edit(run / "run.json", '"steps": ', '"steps": 1'),
    "a check": lambda run: edit(run / "checks.json", "[]", '["failed"]'),
    "a source": lambda run: edit(run / "run.json", '"templates": "', '"templates": "0'),
    "the campaign": lambda run: edit(run / "run.json", '"campaign_digest": "', '"campaign_digest": "0'),
    "the reading": lambda run: edit(run / "run.json", '"reading": "', '"reading": "other_'),
    "the seed": lambda run: edit(run / "run.json", '"seed": ', '"seed": 1'),
    "the runs": lambda run: edit(run / "run.json", '"runs": ', '"runs": 1'),
    "a file of the target": lambda run: edit(
        run / "run.json", '"target_files": {', '"target_files": {"x.py": "0",'
    ),
    "the study": lambda run: edit(run / "run.json", '"study": null', '"study": "paper"'),
    "a choice": lambda run: edit(run / "run.json", '"limit": null', '"limit": 24'),
    "the hazards": lambda run: edit(run / "run.json", '"hazards": [', '"hazards": [\n"H9",'),
    "the channels": lambda run: edit(run / "run.json", '"compared": [', '"compared": [\n"gear",'),
    "mutator": lambda run: edit(run / "run.json", '"mutator": "', '"mutator": "9'),
    "a package": lambda run: edit(run / "run.json", '"numpy": "', '"numpy": "0'),
    "Python": lambda run: edit(run / "run.json", '"python": "CPython 3', '"python": "CPython 4'),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_of_the_result_changes_the_seal(
    made: Path, run: Path, reseal: Reseal, change: str
) -> None:
    CHANGES[change](run)
    reseal(run)
    assert sealed(run) not in (None, sealed(made))


def test_an_unfinished_run_has_no_seal(run: Path) -> None:
    file_digests.add_segments_to_ledger(run, finished=False)
    folder = RunFolder.open(run)
    none = {"seal": "none: the run is not finished"}
    assert (seals_of(folder).seal, digests_or_why_no_seal(folder)) == (None, none)


def test_the_seal_covers_records_as_they_were_written(made: Path, run: Path) -> None:
    """A field that a later version adds to records does not change the seal of an old run."""
    path = run / "records" / "0001-a.jsonl"
    lines = path.read_text().splitlines()
    assert canonical_json(json.loads(lines[1])) != lines[1]  # the checksum is the first key
    assert sealed(run) == sealed(made)


NO_ERROR = '"detail":"","dev":[],"error":null'


def crash(run: Path, detail: str, kind: str, message: str) -> None:
    error = canonical_json({"kind": kind, "message": message, "place": ""})
    edit(run / "records" / "0001-a.jsonl", NO_ERROR, f'"detail":"{detail}","dev":[],"error":{error}')


def results_digest(run: Path, reseal: Reseal) -> str:
    reseal(run)
    found = seals_of(RunFolder.open_unverified(run)).results_digest
    assert found is not None
    return found


def test_the_results_digest_does_not_depend_on_versions(made: Path, run: Path, reseal: Reseal) -> None:
    """Nor on the proof, which the reference engine does without, and files that ids follow from."""
    for change in ONLY_SEALED:
        CHANGES[change](run)
    assert results_digest(run, reseal) == seals_of(RunFolder.open_unverified(made)).results_digest
    assert sealed(run) != sealed(made)


def test_the_results_digest_leaves_out_texts_of_exceptions(run: Path, tmp_path: Path, reseal: Reseal) -> None:
    """They differ between versions of Python, unlike the type of the exception and its place."""
    found = {}
    for text, kind in (("a", "KeyError"), ("b", "KeyError"), ("a", "ValueError")):
        other = Path(shutil.copytree(run, tmp_path / f"{text}{kind}"))
        crash(other, text, kind, text)
        found[text, kind] = results_digest(other, reseal), sealed(other)
    one, with_another_text, of_another_kind = found.values()
    assert one[0] == with_another_text[0] != of_another_kind[0]
    assert one[1] != with_another_text[1]


ONLY_SEALED = {
    "a line of the plan",
    "an unused fault",
    "the campaign's text",
    "the table of the plan",
}  # files
ONLY_SEALED |= {"the proof", "the checked golden runs", "a key of the checks", "a check"}
ONLY_SEALED |= {"mutator", "a package", "Python"}


@pytest.mark.parametrize("change", [one for one in CHANGES if one not in ONLY_SEALED])
def test_any_change_of_a_result_or_its_judgement_changes_the_results_digest(
    made: Path, run: Path, reseal: Reseal, change: str
) -> None:
    CHANGES[change](run)
    assert results_digest(run, reseal) != seals_of(RunFolder.open_unverified(made)).results_digest


def test_the_review_digest_covers_who_decided_what(made: Path, run: Path) -> None:
    """Decisions have a digest of their own, so that a review of the same mutants leaves the seal as it is."""
    said = {"schema": "reviewed/1", "target": "toycar", "groups": [{"group": "0" * 12, "by": "Jane"}]}
    found = []
    for by in ("Jane", "Joe"):
        said["groups"] = [{"group": "0" * 12, "by": by}]
        write_approvals(run, said)
        found.append(seals_of(RunFolder.open(run)))
    assert len({one.review_digest for one in found} | {seals_of(RunFolder.open(made)).review_digest}) == 3
    assert {one.seal for one in found} == {sealed(made)}
    assert "approvals" in unsealed_facts(RunFolder.open(run))
    assert "approvals" not in unsealed_facts(RunFolder.open(made))
