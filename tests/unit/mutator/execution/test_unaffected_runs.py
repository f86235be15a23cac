"""`--since`: an experiment is left out only if nothing that decided its earlier result has changed.

Python 3.11 cannot tell what runs execute, so most tests say it by hand: everything but `Driver.drive`.
"""

import dataclasses
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator import CheckFailed
from mutator.audit.run_audit import run_audit_checks
from mutator.campaigns import run_environment
from mutator.engines import fork_results, reference_engine
from mutator.engines.executed_functions import ExecutedFunctions
from mutator.execution import earlier_run, unaffected_runs
from mutator.execution.code_recording import CodeRecording, RecordingAssignment, executed_parts
from mutator.execution.finished_run_keys import surroundings_by_name
from mutator.execution.records_without_outcome import record_without_outcome
from mutator.execution.session_summary import Summary
from mutator.execution.unaffected_runs import TargetChange, UnaffectedRuns
from mutator.model import RunError, Status
from mutator.store.executed_code import ExecutedCode
from mutator.store.plan_file import iterate_experiments
from mutator.store.preflight_results import golden_digests
from mutator.workspace import Workspace
from tests.run_contents import run_contents, run_modes

pytestmark = [
    pytest.mark.usefixtures("kept_checks"),
    pytest.mark.filterwarnings("ignore:no golden run reaches the trigger"),
]
DRIVER, WORLD, GO = "toycar/driver.py", "toycar/world.py", "toycar/go.py"
EXECUTED = ExecutedFunctions(
    names_by_file={
        "toycar/__init__.py": ("<module>",),
        DRIVER: ("<module>", "Driver", "Driver.__init__"),
        WORLD: ("<module>", "World", "World.__init__", "World.advance", "World.judge"),
        GO: ("<module>", "Drive", "Drive.step", "begin", "npy"),
        "toycar/sensing.py": ("<module>", "Sensor", "Sensor.__init__", "Sensor.sense", "Sensor.publish"),
    }
)
Run = Callable[..., Summary]
CopyToycar = Callable[[Path], Workspace]


@pytest.fixture
def executed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Say what runs execute, in any Python."""
    say_what_runs_execute(monkeypatch)


def say_what_runs_execute(patch: pytest.MonkeyPatch) -> None:
    for engine in (fork_results, reference_engine):
        patch.setattr(engine, "executed_functions_from_json", lambda data: EXECUTED)
    patch.setattr(earlier_run, "CAN_RECORD_CODE", True)


@pytest.fixture(scope="module")
def run_of_pristine_toy(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Path:
    """The folder of an earlier run, before any edit, which nearly every test needs."""
    folder = tmp_path_factory.mktemp("base")
    with pytest.MonkeyPatch.context() as patch:
        say_what_runs_execute(patch)
        mutator.run("small", folder / "run", workspace=copy_toycar(folder), engine="fork", reuse=False)
    return folder / "run"


@pytest.fixture
def base(run_of_pristine_toy: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(run_of_pristine_toy, tmp_path / "base"))


def edit(toycar: Workspace, path: str, old: str, new: str) -> None:
    file = toycar.library.parent / "tree" / path
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


@pytest.mark.usefixtures("executed")
def test_what_a_change_cannot_affect_is_left_out(
    toycar: Workspace, base: Path, tmp_path: Path, run: Run
) -> None:
    """All results and the seal are those of a run of everything; only timings tell the difference, and the
    audit finds nothing. What was left out can be left out again, by each of two workers.
    """
    edit(toycar, DRIVER, "-0.6 * offset", "offset * -0.6")
    quick, full = run("quick", since=base), run("full")
    assert (quick.left_out, quick.done, full.left_out) == (12, 12, 0)
    assert quick.since_note == (
        "since base: 12 of 12 left out, because nothing that they executed has changed"
    )
    assert run_contents(tmp_path / "quick") == run_contents(tmp_path / "full")
    assert run_modes(tmp_path / "quick") == {"unaffected": 12}
    folder = mutator.load_run(tmp_path / "quick").folder
    assert [d for check in run_audit_checks(folder, toycar) for d in check.differences] == []
    assert run("again", since=tmp_path / "quick", workers=2).left_out == 12


@pytest.mark.usefixtures("executed")
def test_what_a_change_can_affect_runs(toycar: Workspace, base: Path, run: Run) -> None:
    """The summary says why. The proof of what was left out is mostly that of the earlier run."""
    edit(toycar, DRIVER, "self.warned = []", "self.warned = list()")
    summary = run("new", since=base)
    assert summary.left_out == 0
    assert summary.since_note == (
        f"since base: 0 of 12 left out; the others ran: {DRIVER} changed in Driver.__init__ (12)"
    )


@pytest.fixture
def asked(toycar: Workspace, base: Path) -> Callable[..., set[str]]:
    """Ask, of the experiments of the run `base`, why they must run now."""

    def reasons(golden_digest: str = "", **changes: object) -> set[str]:
        folder = mutator.load_run(base).folder
        assignment = RecordingAssignment(
            surroundings=surroundings_by_name(toycar, toycar.manifest("toycar")),
            version_by_package=run_environment.versions_of_fixed_packages(),
        )
        recording = CodeRecording(
            dataclasses.replace(assignment, **changes), folder, toycar.manifest("toycar")
        )  # type: ignore[arg-type]
        digests = golden_digests(folder)
        unaffected = UnaffectedRuns(
            folder.path,
            recording,
            toycar.manifest("toycar"),
            lambda experiment: golden_digest or digests[folder.golden_run_of(experiment).key],
        )
        return {unaffected.reason(one) for one in iterate_experiments(folder.path)}

    return reasons


@pytest.mark.usefixtures("executed")
def test_everything_that_decides_a_result_must_be_the_same(
    toycar: Workspace, base: Path, asked: Callable[..., set[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Golden runs, manifest, templates, packages, and lines if the record names them; and it must be known
    what ran.
    """
    assert asked() == {""}
    assert asked(golden_digest="another") == {"the golden run of A changed"}
    assert asked(surroundings={"mutator": "another"}) == {"mutator changed"}
    manifest = toycar.manifest("toycar").path
    text = manifest.read_text()
    manifest.write_text(text + "\n")
    assert asked() == {"the manifest changed"}
    manifest.write_text(text)
    template = toycar.library.parent / "templates" / "offset.py.j2"
    text = template.read_text()
    template.write_text(text + "\n")
    assert asked() == {"the templates changed"}
    template.write_text(text)
    edit(toycar, DRIVER, "-0.6 * offset", "offset * -0.6")
    assert asked() == {""}
    with monkeypatch.context() as patched:
        patched.setattr(unaffected_runs, "_names_lines", lambda record: True)
        assert asked() == {f"{DRIVER} changed, and line numbers count for them"}
    with monkeypatch.context() as patched:
        patched.setattr(unaffected_runs, "is_storable", lambda record: False)
        assert asked() == {"they ended there as ok"}
    for path in (base / "executed").iterdir():
        path.unlink()
    assert asked() == {"what they executed was not recorded"}


CODE = ExecutedCode(parts_by_file={}, files_read={}, packages={}, surroundings={})


class TestTargetChange:
    """What differs between two versions of a target, for a run that executed some of it."""

    @pytest.fixture
    def change(self, toycar: Workspace) -> Callable[..., TargetChange]:
        digests = toycar.manifest("toycar").tree.digest_by_path

        def after(path: str, old: str, new: str) -> TargetChange:
            edit(toycar, path, old, new)
            return TargetChange(toycar.manifest("toycar"), digests)

        return after

    @pytest.fixture
    def code(self, toycar: Workspace) -> ExecutedCode:
        parts = executed_parts(toycar.manifest("toycar").tree, EXECUTED)
        return dataclasses.replace(CODE, parts_by_file=parts)

    @pytest.mark.parametrize(
        ("path", "old", "new", "reason"),
        [
            (WORLD, "now >= 2.0", "now > 2.01", f"{WORLD} changed in World.advance"),
            (WORLD, "now >= 2.0", "now >= 2.00", ""),
            (WORLD, "STEP = 0.05", "STEP = 0.06", f"{WORLD} changed outside of its functions"),
            (WORLD, "STEP = 0.05", "# the step\nSTEP = 0.05", ""),
            (DRIVER, "wanted = min(wanted, 0.0)", "wanted = 0.0", ""),  # not executed
            (
                DRIVER,
                "def drive(self, t,",
                "def drive(self, at,",
                f"{DRIVER} changed outside of its functions",
            ),
            ("toycar/haze.py", '"""', '"""\n', ""),  # not imported
        ],
    )
    def test_only_what_ran_counts(
        self,
        change: Callable[..., TargetChange],
        code: ExecutedCode,
        path: str,
        old: str,
        new: str,
        reason: str,
    ) -> None:
        changed = change(path, old, new)
        assert (changed.reason_for_all, changed.reason_of_code(code)) == ("", reason)

    def test_source_that_was_read_counts_to_the_byte(
        self, change: Callable[..., TargetChange], code: ExecutedCode
    ) -> None:
        read = dataclasses.replace(code, files_read={"toycar/haze.py": "any"})
        changed = change("toycar/haze.py", '"""', '"""\n')
        assert changed.reason_of_code(read) == "toycar/haze.py changed, which they read"

    def test_code_that_reads_line_numbers_must_not_move(
        self, toycar: Workspace, change: Callable[..., TargetChange], code: ExecutedCode
    ) -> None:
        """Even if nothing that it executes changes."""
        edit(toycar, DRIVER, "self.warned = []", "self.warned = []\n        self.lineno = 0")
        before = toycar.manifest("toycar")
        reading = dataclasses.replace(code, parts_by_file=executed_parts(before.tree, EXECUTED))
        edit(toycar, DRIVER, '"""The controller', '"""\nThe controller')
        edit(toycar, DRIVER, '"""\nThe controller', '"""The controller')
        edit(toycar, DRIVER, "wanted = min(wanted, 0.0)", "# brake\n            wanted = min(wanted, 0.0)")
        changed = TargetChange(toycar.manifest("toycar"), before.tree.digest_by_path)
        assert changed.reason_of_code(reading) == f"{DRIVER} changed, and line numbers count for them"

    def test_a_file_that_is_new_or_gone_counts_for_all(self, toycar: Workspace) -> None:
        """An import can find another file, and a run can list its folder."""
        digests = toycar.manifest("toycar").tree.digest_by_path
        (toycar.library.parent / "tree" / "toycar" / "more.py").write_text("")
        now = toycar.manifest("toycar")
        assert TargetChange(now, digests).reason_for_all == "toycar/more.py is new"
        gone = {**now.tree.digest_by_path, "toycar/old.py": "any"}
        assert TargetChange(now, gone).reason_for_all == "toycar/old.py is gone"

    def test_data_counts_for_all(self, toycar: Workspace) -> None:
        """Nobody knows which run reads it."""
        manifest = toycar.manifest("toycar")
        reading = dataclasses.replace(manifest, globs_read_by_runs=("toycar/w*.py",))
        digests = {**manifest.tree.digest_by_path, WORLD: "another"}
        assert TargetChange(reading, digests).reason_for_all == f"{WORLD} changed, which is data"


@pytest.mark.parametrize(
    ("detail", "error", "names"),
    [
        ("", None, False),
        ("the trigger never held", None, False),
        ("f is replaced by g (car/a.py:3)", None, True),
        ("boom", RunError(kind="ValueError", message="boom", place=""), True),
    ],
)
def test_records_with_line_numbers(detail: str, error: RunError | None, names: bool) -> None:
    bare = record_without_outcome("a", Status.OK, detail)
    record = dataclasses.replace(bare, error=error)
    assert unaffected_runs._names_lines(record) is names


@pytest.mark.usefixtures("executed")
def test_a_wrong_decision_fails_the_proof(
    toycar: Workspace, base: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the sample of the proof, one that was left out runs all the same."""
    edit(toycar, WORLD, "now >= 2.0", "now >= 1.0")
    monkeypatch.setattr(UnaffectedRuns, "reason", lambda self, experiment: "")
    with pytest.raises(CheckFailed, match="differs on the reference engine"):
        run("new", since=base)


@pytest.mark.usefixtures("executed")
def test_most_of_the_proof_is_that_of_the_earlier_run(
    base: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise, the proof would take longer than everything else."""
    jobs: list[str] = []
    execute = reference_engine.ReferenceEngine.execute

    def noted(self: Any, job: Any, folder: Path) -> Any:
        jobs.append(job.name)
        return execute(self, job, folder)

    monkeypatch.setattr(reference_engine.ReferenceEngine, "execute", noted)
    summary = run("new", since=base)
    assert summary.proof is not None
    assert (summary.proof.sampled, summary.proof.is_complete) == (3, True)
    planned = {*mutator.load_run(tmp_path / "new").folder.experiment_ids()}
    assert len(planned.intersection(jobs)) == 1


@pytest.mark.usefixtures("executed")
def test_results_from_the_store_keep_what_they_executed(toycar: Workspace, tmp_path: Path, run: Run) -> None:
    """Else nothing could be left out after a run whose results were copied from other runs."""
    workspace = {"workspace": toycar, "engine": "fork"}
    mutator.run("small", tmp_path / "first", **workspace)
    second = mutator.run("small", tmp_path / "second", **workspace).summary
    assert second is not None
    assert second.reused == 12
    assert run("third", since=tmp_path / "second").left_out == 12


@pytest.mark.skipif(not hasattr(sys, "monitoring"), reason="sys.monitoring needs Python 3.12")
@pytest.mark.parametrize(
    ("path", "old", "new", "left_out"),
    [
        (DRIVER, "# no", "# no", 12),
        (DRIVER, "brake > 0.9", "brake > 0.8", 0),
        (GO, "film.mkdir()", "film.mkdir(exist_ok=True)", 12),
        ("toycar/haze.py", '"""', '"""\n', 12),
        (WORLD, "STEP = 0.05", "STEP = 0.050", 12),
        (WORLD, "STEP = 0.05", "STEP = 0.06", 0),
    ],
)
def test_what_runs_executed_is_recorded(
    toycar: Workspace, tmp_path: Path, run: Run, path: str, old: str, new: str, left_out: int
) -> None:
    """With Python's own record, the results are those of a run of everything."""
    tree = toycar.library.parent / "tree"
    (tree / DRIVER).write_text((tree / DRIVER).read_text() + "# no\n")
    run("base")
    edit(toycar, path, old, new)
    quick = run("quick", since=tmp_path / "base")
    assert quick.left_out == left_out
    assert quick.seal == run("full").seal
