"""The runs of the checks: how many there are, and what fork engines take from them."""

from collections import Counter
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.first_activation import GoldenObservations
from mutator.engines.golden_run_keys import golden_run_id
from mutator.engines.observation_store import ObservationStore
from mutator.engines.reference_engine import ReferenceEngine
from mutator.preflight.preflight_checks import run_checks
from mutator.workspace import Workspace

SECRET = b"of a session"
GO = "tree/toycar/go.py"


def edit(toycar: Workspace, file: str, old: str, new: str) -> None:
    path = toycar.library.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


@pytest.fixture
def run_kinds(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count the runs of the checks by the first letter of their names."""
    kinds: Counter[str] = Counter()
    genuine = ReferenceEngine.execute

    def execute(engine: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        kinds[job.name[0]] += 1
        return genuine(engine, job, folder)

    monkeypatch.setattr(ReferenceEngine, "execute", execute)
    return kinds


def observations_after_checks(toycar: Workspace, tmp_path: Path) -> list[GoldenObservations | None]:
    """Return what the checks stored for the golden runs A and A+alone; all checks pass."""
    folder = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    assert all(result.passed for result in run_checks(toycar, folder, secret=SECRET))
    store = ObservationStore(folder.scratch_folder, SECRET)
    keys = [("A", ()), ("A", ("alone",))]
    jobs = [
        Job(name="x", scenario=toycar.scenario(scenario), seed=folder.head.seed, scenario_changes=changes)
        for scenario, changes in keys
    ]
    return [store.load(golden_run_id(job)) for job in jobs]


def test_a_sound_golden_run_is_driven_twice_in_all(
    toycar: Workspace, tmp_path: Path, run_kinds: Counter[str]
) -> None:
    """The null mutant, under another hash seed and step by step, is repetition, null mutant and watch in one.
    Fork engines get what it observed, and which libraries it loaded late.
    """
    edit(toycar, GO, "        world.judge(now)", "        world.judge(now)\n        import colorsys")
    observations = observations_after_checks(toycar, tmp_path)
    assert run_kinds == {"a": 2, "n": 2, "c": 1}
    for observed in observations:
        assert observed is not None
        assert len(observed.values) == len(observed.counts_before_steps) > 100
        assert observed.counts_before_steps[:3] == (0, 1, 2)
        assert "colorsys" in observed.imported_modules


EARLY = """
        self.steps = int(case["steps"])
        self.look(-1.0)

    def look(self, at):
        world = self.world
        now = at
        self.seen = now
"""
THREAD = """        import threading
        threading.Thread(target=threading.Event().wait, daemon=True).start()
        names = ("time","""


@pytest.mark.parametrize(
    ("edits", "further_runs"),
    [
        (
            ((GO, "    drive = begin(arguments)\n", "    drive = begin(arguments)\n    drive.steps -= 1\n"),),
            4,
        ),
        (
            (
                ("fault_library/targets/toycar.yaml", "function: Drive.step,", "function: Drive.look,"),
                (GO, '\n        self.steps = int(case["steps"])\n', EARLY),
                (GO, "        world.judge(now)", "        world.judge(now)\n        self.look(now)"),
            ),
            0,
        ),
        (((GO, '        names = ("time",', THREAD),), 0),
    ],
    ids=["differs step by step", "observes before its first step", "leaves a thread"],
)
def test_what_forbids_forks_fails_no_check_and_stores_no_observations(
    toycar: Workspace,
    tmp_path: Path,
    run_kinds: Counter[str],
    edits: tuple[tuple[str, str, str], ...],
    further_runs: int,
) -> None:
    """The reference engine can run such a target. The fork engine drives it again, and says why it cannot."""
    for change in edits:
        edit(toycar, *change)
    assert observations_after_checks(toycar, tmp_path) == [None, None]
    assert run_kinds["b"] + run_kinds["m"] == further_runs
