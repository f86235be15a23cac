"""Classes of crashes that the reference engine confirms, and the lines of a fork's stack."""

import os
from pathlib import Path
from typing import Any

import pytest

from mutator.engines.authenticated_files import AuthenticatedFiles
from mutator.engines.crashes_in_forks import NEEDED_CONFIRMATIONS, CrashKinds, judge_crash
from mutator.engines.engine_jobs import CrashKind, Job
from mutator.engines.in_target.fork_output import ForkOutput
from mutator.engines.process_endings import ProcessEnding
from mutator.engines.received_fork_output import ReceivedForkOutput

ENDED = ProcessEnding(code=0, cpu_s=0.1, wall_s=0.1, stopped="")
MUTATED = b"""import _fi  # fi:probe
def f():
    a = 1
    a = 2  # fi:abc
    return g()

def g():
    1 / 0
"""


def kinds(folder: Path, secret: bytes = b"s") -> CrashKinds:
    return CrashKinds(AuthenticatedFiles(folder, secret))


def kind(classes: str = "a", place: str = "p") -> CrashKind:
    return CrashKind(classes_id=classes, place_id=f"{classes}-{place}")


def test_classes_need_three_confirmations_by_any_worker_and_each_place_one(tmp_path: Path) -> None:
    for place in range(NEEDED_CONFIRMATIONS):
        assert not kinds(tmp_path).is_confirmed(kind(place="0"))
        kinds(tmp_path).note(kind(place=str(place)), is_same=True)
    assert all(kinds(tmp_path).is_confirmed(kind(place=str(place))) for place in range(NEEDED_CONFIRMATIONS))
    assert not kinds(tmp_path).is_confirmed(kind(place="new"))
    assert not kinds(tmp_path).is_confirmed(kind(classes="b"))
    assert not kinds(tmp_path, b"of somebody else").is_confirmed(kind(place="0"))


def test_one_other_result_of_the_reference_engine_excludes_the_classes_for_every_worker(
    tmp_path: Path,
) -> None:
    worker = kinds(tmp_path)
    for _ in range(NEEDED_CONFIRMATIONS):
        worker.note(kind(), is_same=True)
    assert worker.is_confirmed(kind())
    kinds(tmp_path).note(kind(place="other"), is_same=False)
    worker.note(kind(), is_same=True)
    assert not worker.is_confirmed(kind())


def judge(work: Path, ended: ProcessEnding = ENDED, active: bool = True, **changes: Any) -> Any:
    frames = [["a.py", 6, 4, False], ["a.py", 5, 11, True]]
    report = {
        "ended": "error",
        "error": {"kind": "ZeroDivisionError", "message": "division by zero", "stacks": [[]]},
        "crash": {"classes": ["builtins.ZeroDivisionError"], "frames": [frames]},
        "threads": [],
        "probe": None,
    }
    output = ForkOutput()
    if active:
        output.note_activation()
    job = Job(name="j", scenario=work, seed=1, changed_files={"a.py": MUTATED})
    with ReceivedForkOutput(os.dup(output.report), os.dup(output.log)) as received:
        output.close()
        return judge_crash(job, report | changes, ended, received, work)


def test_the_lines_of_unchanged_functions_are_those_of_the_mutant(tmp_path: Path) -> None:
    """They ran the code of the pristine file, in which they have other lines."""
    crash = judge(tmp_path)
    assert crash.exception.stacks == ((("a.py", 8, 4), ("a.py", 5, 11)),)
    assert crash.exception.place == "a.py:6"


@pytest.mark.parametrize(
    "changes",
    [
        {"ended": ProcessEnding(code=1, cpu_s=0.1, wall_s=0.1, stopped="")},
        {"ended": ProcessEnding(code=-11, cpu_s=0.1, wall_s=0.1, stopped="")},
        {"ended": ProcessEnding(code=0, cpu_s=0.1, wall_s=0.1, stopped="wall")},
        {"active": False},
        {"threads": ["pool"]},
        {"crash": None},
        {"crash": {"classes": ["builtins.ZeroDivisionError"], "frames": [[["a.py"]]]}},
        {"crash": {"frames": []}},
    ],
    ids=str,
)
def test_what_a_fork_alone_does_not_show_is_left_to_the_reference_engine(
    tmp_path: Path, changes: dict[str, Any]
) -> None:
    assert judge(tmp_path, **changes) is None


def test_message_and_place_count_beside_the_classes(tmp_path: Path) -> None:
    """A message can tell something about the process, and an entry module can catch by message."""
    error = {"kind": "ZeroDivisionError", "message": "float division by zero", "stacks": [[]]}
    frames = [["a.py", 5, 4, False], ["a.py", 5, 11, True]]
    crash = {"classes": ["builtins.ZeroDivisionError"], "frames": [frames]}
    judged = judge(tmp_path), judge(tmp_path), judge(tmp_path, error=error), judge(tmp_path, crash=crash)
    same, again, *others = (each.kind for each in judged)
    assert same == again and same not in others
    assert {other.classes_id for other in others} == {same.classes_id}


def test_a_message_with_a_folder_of_the_run_is_left_to_the_reference_engine(tmp_path: Path) -> None:
    error = {"kind": "ZeroDivisionError", "message": f"no {tmp_path}/x", "stacks": [[]]}
    assert judge(tmp_path, error=error) is None
