"""Which workers can join a run, and how they are described."""

import pytest

from mutator._common.version import VERSION
from mutator.execution.cluster.worker_roster import WorkerRoster, describe_worker
from mutator.store.session_environments import SessionEnvironment

FACTS = {
    "mutator": VERSION,
    "host": "alpha",
    "python": "CPython 3.11.7",
    "platform": "Linux",
    "cpu": "AMD EPYC",
    "blas": [{"library": "openblas", "version": "0.3.31", "kernel": "Zen", "threads": 1}],
    "packages": {"numpy": "2.4.6"},
}
STRETCH = SessionEnvironment(python="CPython 3.11.7", packages={"numpy": "2.4.6"}, platform="Linux")


@pytest.mark.parametrize(
    ("change", "objection"),
    [
        ({}, ""),
        ({"mutator": "0.0.1"}, f"mutator 0.0.1, here {VERSION}"),
        ({"python": "CPython 3.12.1"}, "CPython 3.11.7, there CPython 3.12.1"),
        ({"packages": {"numpy": "1.0"}}, "numpy 2.4.6, there 1.0"),
        ({"packages": {"numpy": None}}, "numpy 2.4.6, there none"),
        ({"host": "beta", "cpu": "another"}, ""),
    ],
)
def test_a_worker_with_other_versions_is_refused(change: dict[str, object], objection: str) -> None:
    assert WorkerRoster(STRETCH, accept=False).reason_to_refuse(FACTS | change) == objection


def test_other_versions_can_be_accepted() -> None:
    crew = WorkerRoster(STRETCH, accept=True)
    assert crew.reason_to_refuse(FACTS | {"packages": {"numpy": "1.0"}}) == ""
    assert crew.reason_to_refuse(FACTS | {"mutator": "0.0.1"})


def test_the_rate_of_each_machine_is_reported() -> None:
    now = [0.0]
    crew = WorkerRoster(STRETCH, accept=False, now=lambda: now[0])
    for name, host in (("a", "alpha"), ("b", "alpha"), ("c", "beta")):
        crew.admit_worker(name, FACTS | {"host": host})
    for _ in range(3):
        now[0] += 2.0
        crew.note_finished_piece("a", 4)
        crew.note_finished_piece("b", 2)
    crew.refuse_worker("d", "numpy 1.0")
    assert crew.describe_workers() == "3 workers on alpha (3.0 a second), beta; 1 refused"
    crew.remove_worker("c")
    assert crew.describe_workers().startswith("2 workers on alpha")


def test_a_worker_is_described_by_its_machine_and_versions() -> None:
    assert describe_worker("w", FACTS) == (
        f"w (alpha, AMD EPYC, CPython 3.11.7, mutator {VERSION}, openblas 0.3.31 (Zen))"
    )
    assert describe_worker("w", {}) == "w"
