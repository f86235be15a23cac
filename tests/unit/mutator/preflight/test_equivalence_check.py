"""The equivalence check."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from mutator.api.audits import verify
from mutator.engines.engine_choice import choose_engine
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.model import Experiment
from mutator.preflight import equivalence_check
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store import file_digests
from mutator.store.checksummed_lines import LineWriter, read_segment
from mutator.store.plan_choices import Choices
from mutator.store.records import RECORDS_SCHEMA, load_records
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

Reseal = Callable[..., None]


def test_the_sample_has_every_fault_type_and_scenario(experiment: Callable[..., Experiment]) -> None:
    many = [experiment(value, f"S{value % 5:.0f}") for value in range(3000)]
    rare = experiment(1.0, "S9", spec="vision/rain/rate")
    sample = equivalence_check.choose_sample([*many, rare], 1)
    assert 31 <= len(sample) <= 32
    assert rare in sample
    assert {e.scenario for e in sample} == {"S0", "S1", "S2", "S3", "S4", "S9"}
    assert sample == equivalence_check.choose_sample([*many, rare], 1)
    assert sample != equivalence_check.choose_sample([*many, rare], 2)
    assert len(equivalence_check.choose_sample(many[:100], 1)) == 20
    assert [len(equivalence_check.choose_sample(many[:count], 1)) for count in (2, 7, 31, 39, 40)] == [
        2,
        3,
        4,
        4,
        20,
    ]


@pytest.mark.parametrize("rare_count", [0, 2, 12])
def test_a_small_sample_notices_what_its_statement_claims(
    experiment: Callable[..., Experiment], rare_count: int
) -> None:
    """Of 39 experiments, 4 are drawn. If 20 records are changed, 95 % of the samples have one, wherever the
    changed records lie."""
    rare = [experiment(1.0, spec=f"vision/rain/rate{number}") for number in range(rare_count)]
    planned = [*(experiment(value) for value in range(39 - rare_count)), *rare]
    changed_ids = {changed.id for changed in planned[:20]}
    samples = [equivalence_check.choose_sample(planned, seed) for seed in range(300)]
    noticed = [any(drawn.id in changed_ids for drawn in sample) for sample in samples]
    assert 0.93 <= sum(noticed) / len(samples) < 1.0


@pytest.fixture
def proven(toycar: Workspace, tmp_path: Path) -> Path:
    """A run folder with two experiments from the fork engine and their equivalence check."""
    summary = run_campaign(toycar, "small", tmp_path / "run", engine="fork", choices=Choices(limit=2))
    assert summary.proof == equivalence_check.EquivalenceResult(sampled=2, same=2)
    assert summary.exit_code == 0
    return tmp_path / "run"


@pytest.mark.slow
def test_a_record_that_differs_fails_the_campaign(toycar: Workspace, proven: Path, reseal: Reseal) -> None:
    (path,) = (proven / "records").iterdir()
    lines = path.read_text().splitlines()
    record = json.loads(lines[1])
    path.write_text("\n".join([lines[0], json.dumps(record | {"trace_digest": "0" * 64}), *lines[2:], ""]))
    reseal(proven)
    with pytest.raises(CheckFailed, match=f"experiment {record['experiment_id']} .*trace_digest '000"):
        run_campaign(toycar, "small", proven)


@pytest.mark.slow
def test_an_incomplete_check_is_resumed(toycar: Workspace, proven: Path, reseal: Reseal) -> None:
    (path,) = (proven / "proof").iterdir()
    path.write_text(path.read_text().splitlines()[0] + "\n")
    reseal(proven, finished=False)
    folder = RunFolder.open(proven)
    assert len(equivalence_check.remaining_sampled_experiments(folder)) == 2
    records = load_records(proven)
    assert equivalence_check.compare_sample(folder, records) == equivalence_check.EquivalenceResult(
        sampled=2, same=0
    )
    summary = run_campaign(toycar, "small", proven, engine="reference")
    assert (summary.proof, summary.ran, summary.exit_code) == (
        equivalence_check.EquivalenceResult(sampled=2, same=2),
        0,
        0,
    )
    assert equivalence_check.remaining_sampled_experiments(folder) == ()


@pytest.mark.slow
def test_the_reference_engine_needs_no_proof(toycar: Workspace, tmp_path: Path) -> None:
    summary = run_campaign(toycar, "small", tmp_path / "run", engine="reference", choices=Choices(limit=1))
    assert (summary.proof, summary.proof_note) == (None, "")
    assert not (tmp_path / "run" / "proof").exists()


_BELIEVE = """
    drive = Drive(case)
    known = "0 0" if "--forget" in arguments else Path("{kept}").read_text()
    drive.world.since, drive.world.more = map(float, known.split())
    return drive
"""


@pytest.fixture
def sharing(toycar: Workspace, tmp_path: Path) -> Workspace:
    """A toy whose runs read the start and the rate of the car's drift from a shared file, unless `--forget`
    is given."""
    go, world = (tmp_path / "toy/tree/toycar" / name for name in ("go.py", "world.py"))
    believe = _BELIEVE.replace("{kept}", str(tmp_path / "kept"))
    go.write_text(go.read_text().replace("\n    return Drive(case)\n", believe))
    line = "        self.frame += 1\n"
    misled = line + "        self.offset += self.more * (now > self.since)\n"
    world.write_text(world.read_text().replace(line, misled))
    (path,) = (toycar.library / "targets").iterdir()
    path.write_text(path.read_text().replace("entry:\n", "entry:\n  independent: [--forget]\n"))
    return toycar


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kept", "told"),
    [
        ("0.0 0.0", ""),
        ("5.7 0.01", "differs on the reference engine"),
        ("0.5 0.01", "in the proof: differs from the golden run at 0."),
    ],
)
def test_an_error_that_runs_share_fails_the_campaign(
    sharing: Workspace, tmp_path: Path, kept: str, told: str
) -> None:
    (tmp_path / "kept").write_text(kept)
    out = tmp_path / "run"
    try:
        summary = run_campaign(sharing, "small", out, engine="fork", choices=Choices(limit=1))
        found, code = " ".join(map(": ".join, summary.harness_errors)), summary.exit_code
    except CheckFailed as err:
        found, code = str(err), err.exit_code
    (name,) = load_records(out)
    if told:
        assert code and name in found and told in found
    else:
        assert (code, found) == (0, "")


@pytest.mark.parametrize(
    ("same", "errors", "text"),
    [
        (8, (), "8 of 8 experiments came out the same on the reference engine"),
        (0, ("no memory",) * 8, "none of 8 experiments could be judged: 8 harness errors (no memory)"),
        (
            7,
            ("no memory",),
            "7 of 8 experiments came out the same on the reference engine; the others could not be judged: "
            "1 harness error (no memory)",
        ),
        (0, (), "none of 8 experiments could be judged: they have no result yet"),
    ],
)
def test_a_proof_without_results_does_not_read_like_a_difference(
    same: int, errors: tuple[str, ...], text: str
) -> None:
    result = EquivalenceResult(
        sampled=8, same=same, errors=tuple(("id", f"in the proof: {detail}") for detail in errors)
    )
    assert str(result) == text


def test_campaigns_fork_by_default(toycar: Workspace) -> None:
    manifest = toycar.manifest("toycar")
    assert choose_engine(None, manifest) == "fork"
    assert choose_engine("fork", manifest) == "fork"
    assert choose_engine("reference", manifest) == "reference"
    plain = replace(manifest, stepwise_function=None)
    assert choose_engine(None, plain) == "reference"
    for asked, told in (("fork", "names no `entry.stepwise`"), ("turbo", "engine 'turbo'")):
        with pytest.raises(MutatorError, match=told):
            choose_engine(asked, plain)


@pytest.fixture
def threaded(toycar: Workspace, tmp_path: Path) -> Workspace:
    """A toy that cannot be forked, because it starts a thread when it is loaded."""
    go = tmp_path / "toy/tree/toycar/go.py"
    wait = "wait = threading.Event().wait\nthreading.Thread(target=wait, name='poll', daemon=True).start()"
    go.write_text(go.read_text().replace("class Drive:", f"import threading\n\n{wait}\n\n\nclass Drive:"))
    return toycar


@pytest.mark.slow
def test_without_forks_there_is_no_equivalence_check(threaded: Workspace, tmp_path: Path) -> None:
    summary = run_campaign(threaded, "small", tmp_path / "run", engine="fork", choices=Choices(limit=1))
    assert (summary.proof, summary.exit_code) == (None, 0)
    assert summary.not_forked.endswith("only one can be forked: besides the main one, 'poll'")
    assert not (tmp_path / "run" / "proof").exists()
    assert verify(tmp_path / "run", workspace=threaded).passed
    other = run_campaign(threaded, "small", tmp_path / "other", engine="reference", choices=Choices(limit=1))
    assert summary.seal == other.seal


def test_a_small_campaign_is_forked_and_its_proof_says_what_it_can_exclude(
    toycar: Workspace, tmp_path: Path
) -> None:
    """Of five experiments, three are proved: few enough to say what they cannot show."""
    summary = run_campaign(toycar, "small", tmp_path / "run", choices=Choices(limit=5))
    assert summary.proof is not None and (summary.proof.sampled, summary.proof.same) == (3, 3)
    assert summary.proof_note.startswith(
        "3 of 3 experiments came out the same on the reference engine; an engine that changes 60% of the "
        "records or more would have been noticed with a chance of 95%"
    )
    again = run_campaign(toycar, "small", tmp_path / "run")
    assert again.proof_note == summary.proof_note


@pytest.mark.slow
def test_runs_of_an_unneeded_check_are_deleted(threaded: Workspace, tmp_path: Path) -> None:
    """If these runs stayed, the seal would depend on timing."""
    run = tmp_path / "run"
    seal = run_campaign(threaded, "small", run, engine="fork", choices=Choices(limit=2)).seal
    folder = RunFolder.open(run)
    (path,) = (run / "records").iterdir()
    (run / "proof").mkdir()
    lines = list(read_segment(path).numbered_objects(RECORDS_SCHEMA))
    writer = LineWriter(run / "proof" / path.name, {"schema": RECORDS_SCHEMA, "plan": folder.head.plan})
    for _, line in lines[:1]:
        writer.append(line)
    writer.close()
    file_digests.add_segments_to_ledger(run)
    assert equivalence_check.remaining_sampled_experiments(folder) == ()
    summary = run_campaign(threaded, "small", run, engine="fork")
    assert (summary.proof, summary.seal) == (None, seal)
    assert not (run / "proof").exists()


@pytest.mark.slow
def test_an_experiment_that_must_run_again_can_be_forked(toycar: Workspace, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run_campaign(toycar, "small", run, engine="reference", choices=Choices(limit=2))
    folder = RunFolder.open(run)
    assert equivalence_check.reason_check_not_needed(folder) is not None
    for path in (run / "records").iterdir():
        path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))
    assert equivalence_check.reason_check_not_needed(RunFolder.open_unverified(run)) is None


def test_the_sample_of_a_bench_only_grows(experiment: Callable[..., Experiment]) -> None:
    """What `prove` has proved stays in the sample when the bench grows."""
    planned = [experiment(number) for number in range(400)]
    planned[150] = experiment(150, scenario="rare")
    samples = [equivalence_check.sample_of_bench(planned[:count], 3) for count in range(0, 401, 25)]
    for smaller, larger in pairwise(samples):
        assert smaller.drawn <= larger.drawn and smaller.chosen <= larger.chosen
    last = samples[-1]
    assert not last.drawn & last.chosen
    assert {e.id for e in planned[:3]} <= last.drawn | last.chosen
    assert planned[150].id in last.drawn | last.chosen
    assert 10 <= len(last.drawn) <= 35
    assert equivalence_check.sample_of_bench(planned, 4).drawn != last.drawn


def test_chosen_members_are_no_part_of_the_share() -> None:
    """A share is about what was drawn; what was chosen is told besides."""
    both = equivalence_check.EquivalenceResult(sampled=12, same=12, chosen=4, same_chosen=4)
    assert both.is_complete
    assert str(both) == (
        "12 of 12 experiments that were drawn came out the same on the reference engine; besides, 4 of 4 "
        "chosen among the first 3 or as the first of their fault type or scenario"
    )
    chosen = equivalence_check.EquivalenceResult(sampled=0, same=0, chosen=4, same_chosen=3)
    assert not chosen.is_complete
    assert str(chosen) == (
        "3 of 4 chosen among the first 3 or as the first of their fault type or scenario came out the same "
        "on the reference engine; no experiment was drawn"
    )
