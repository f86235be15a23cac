"""Whether a run that ends with an error is blamed on the target, the mutant or the harness."""

from pathlib import Path

import pytest

from mutator.engines.engine_jobs import Job, JobResult, TargetStack
from mutator.engines.process_endings import exception_in_report
from mutator.model import RunError, Status
from mutator.outcomes.failure_cause import judge_failure, run_error

FILES = {
    "car/radar.py": b"""from car import _fi  # fi:probe
def measure(truth):
    d_rel = truth.d_rel
    if _fi.active("0a1b2c3d"):  # fi:0a1b2c3d
        d_rel = _fi.flip_bit(d_rel, 3)  # fi:0a1b2c3d
    send(d_rel)
""",
    "car/go.py": b"_fi.observe(t=now)  # fi:observe\n",
}
TARGET, GUARD, INJECTED = ("car/radar.py", 6, 4), ("car/radar.py", 4, 4), ("car/radar.py", 5, 4)
ELSEWHERE, OBSERVES, PROBE = ("car/can.py", 5, 4), ("car/go.py", 1, 4), ("car/_fi.py", 70, 4)


def execution(
    *stacks: TargetStack,
    status: Status = Status.CRASHED,
    active: bool = True,
    kind: str = "ValueError",
    probe: bool = True,
) -> JobResult:
    error = {"kind": kind, "message": "no", "stacks": stacks} if stacks else None
    raised = exception_in_report(
        {"error": error}, Job(name="j", scenario=Path(), seed=0, changed_files=FILES)
    )
    return JobResult(
        status=status,
        detail=raised.description if raised else "why",
        out=Path(),
        probe_report={} if probe else None,
        cpu_s=0.0,
        wall_s=0.0,
        exception=raised,
        was_fault_active=active,
    )


@pytest.mark.parametrize(
    ("stack", "status"),
    [
        ((TARGET,), Status.CRASHED),
        ((ELSEWHERE, TARGET), Status.CRASHED),
        ((), Status.CRASHED),
        ((INJECTED, ELSEWHERE), Status.INVALID_MUTANT),
        ((PROBE, INJECTED, ELSEWHERE), Status.INVALID_MUTANT),
        ((ELSEWHERE, INJECTED), Status.INVALID_MUTANT),
        ((PROBE, GUARD, ELSEWHERE), Status.HARNESS_ERROR),
        ((PROBE, OBSERVES), Status.HARNESS_ERROR),
        ((OBSERVES,), Status.HARNESS_ERROR),
        ((ELSEWHERE, OBSERVES), Status.HARNESS_ERROR),
        ((PROBE,), Status.HARNESS_ERROR),
        ((PROBE, ELSEWHERE), Status.HARNESS_ERROR),
    ],
)
def test_the_lines_on_the_stack_determine_the_blame(stack: TargetStack, status: Status) -> None:
    assert judge_failure(execution(stack), FILES, ())[0] is status


CHANGED = {
    "car/radar.py": b"""def measure(truth):
    gap = at(1) + (scaled(truth.d, 2) if _fi.active("0a1b2c3d") else truth.d)  # fi:0a1b2c3d was:    gap =
    at(1) + truth.d
"""
}


@pytest.mark.parametrize(
    ("stack", "status"),
    [
        ((("car/radar.py", 2, 19),), Status.INVALID_MUTANT),
        ((("car/can.py", 5, 0), ("car/radar.py", 2, 19)), Status.CRASHED),
        ((PROBE, ("car/radar.py", 2, 19)), Status.INVALID_MUTANT),
        ((PROBE, ("car/radar.py", 2, 41)), Status.HARNESS_ERROR),
        ((("car/radar.py", 2, 10),), Status.CRASHED),
        ((("car/can.py", 5, 0), ("car/radar.py", 2, 10)), Status.CRASHED),
        ((("car/radar.py", 2, 69),), Status.CRASHED),
        ((("car/radar.py", 2, -1),), Status.CRASHED),
    ],
)
def test_the_mutant_is_blamed_only_for_the_injected_part_of_a_line(
    stack: TargetStack, status: Status
) -> None:
    assert judge_failure(execution(stack), CHANGED, ())[0] is status


IN_A_STRING = b"""def say(low):
    text = '''it's
    ''' + str((None.x if _fi.active("a0") else low))  # fi:a0 was:    ''' + str(low)
"""
LATIN = """# coding: latin-1
def say(x):
    return "\xe9\xe9" + (1 / 0 if _fi.active("a0") else x) + []  # fi:a0 was:    return "\xe9\xe9" + x + []
""".encode("latin-1")
TWO = b"""def say(x):
    a = (no() if _fi.active("a0") else x), (1 / 0 if _fi.active("b1") else 1)  # fi:a0+b1 was:    a = x, 1
"""


@pytest.mark.parametrize(
    ("data", "of_fault"),
    [(IN_A_STRING, "None.x"), (LATIN, "1 / 0"), (TWO, "no()"), (TWO, "1 / 0")],
)
def test_columns_of_the_injected_part_are_counted_in_utf_8_bytes(data: bytes, of_fault: str) -> None:
    encoding = "latin-1" if b"latin" in data else "utf-8"
    number = 1 + next(n for n, line in enumerate(data.splitlines()) if b"# fi:" in line)
    line = data.splitlines()[number - 1].decode(encoding)
    begin = len(line[: line.index(of_fault)].encode())
    end = len(line[: line.index(" if _fi", line.index(of_fault))].encode())
    told = {
        column: judge_failure(execution((("car/radar.py", number, column),)), {"car/radar.py": data}, ())[0]
        for column in (begin - 2, begin, end - 1, len(line[: line.index(" else ")].encode()))
    }
    assert list(told.values()) == [
        *(Status.CRASHED, Status.INVALID_MUTANT, Status.INVALID_MUTANT, Status.CRASHED)
    ]


def test_an_intended_exception_excuses_no_other_injection() -> None:
    line = TWO.splitlines()[1]
    columns = [line.index(b"no()"), line.index(b"1 / 0")]
    told = [
        judge_failure(execution((("car/radar.py", 2, column),)), {"car/radar.py": TWO}, ("a0",))[0]
        for column in columns
    ]
    assert told == [Status.CRASHED, Status.INVALID_MUTANT]


def test_the_message_names_the_users_line_or_the_reason() -> None:
    """Lines are those of the target's own file, which has no injected lines."""
    told = [
        judge_failure(execution(stack), FILES, ()) for stack in ((TARGET,), (ELSEWHERE, INJECTED), (PROBE,))
    ]
    assert [detail for _, detail in told] == [
        "ValueError: no (car/radar.py:3)",
        "car/radar.py:2: the injected `d_rel = _fi.flip_bit(d_rel, 3)` ended the run: "
        "ValueError: no (car/can.py:5)",
        "the probe failed: ValueError: no",
    ]


def test_lines_above_the_anchor_have_the_line_of_the_statement_below() -> None:
    above = judge_failure(execution((INJECTED, ELSEWHERE)), FILES, (), ("0a1b2c3d",))
    assert above[1].startswith("car/radar.py:3: the injected ")


def test_an_intended_exception_is_a_crash() -> None:
    assert judge_failure(execution((INJECTED,)), FILES, ("0a1b2c3d",))[0] is Status.CRASHED
    assert judge_failure(execution((INJECTED,)), FILES, ("ffffffff",))[0] is Status.INVALID_MUTANT
    assert judge_failure(execution((PROBE, GUARD)), FILES, ("0a1b2c3d",))[0] is Status.HARNESS_ERROR


@pytest.mark.parametrize("status", [Status.CRASHED, Status.TIMEOUT])
@pytest.mark.parametrize("stacks", [(), ((TARGET,),), ((INJECTED,),)])
def test_a_fault_is_not_blamed_before_its_activation(status: Status, stacks: tuple[TargetStack, ...]) -> None:
    told = judge_failure(execution(*stacks, status=status, active=False), FILES, ("0a1b2c3d",))
    assert told[0] is Status.HARNESS_ERROR
    assert told[1].endswith(", before the fault was active")


def test_a_run_without_an_exception_keeps_its_status() -> None:
    for status in (Status.CRASHED, Status.TIMEOUT):
        assert judge_failure(execution(status=status, probe=False), FILES, ()) == (status, "why")
    told = judge_failure(execution(status=Status.HARNESS_ERROR, active=False), FILES, ())
    assert told == (Status.HARNESS_ERROR, "why")


def test_the_first_of_chained_exceptions_is_blamed() -> None:
    assert judge_failure(execution((TARGET,), (ELSEWHERE,)), FILES, ())[0] is Status.CRASHED
    assert judge_failure(execution((TARGET,), (INJECTED,)), FILES, ())[0] is Status.INVALID_MUTANT
    assert judge_failure(execution((INJECTED,), (OBSERVES,)), FILES, ())[0] is Status.HARNESS_ERROR


def test_endless_recursion_in_the_targets_code_is_blamed_on_the_target() -> None:
    """The last call before the recursion limit can be in an injected line."""
    for top in ((INJECTED,), (PROBE, INJECTED), (GUARD,), (PROBE, GUARD)):
        deep = execution((*top, TARGET, ELSEWHERE), kind="RecursionError")
        assert judge_failure(deep, FILES, ())[0] is Status.CRASHED
    inside = execution((TARGET, INJECTED, ELSEWHERE), kind="RecursionError")
    assert judge_failure(inside, FILES, ())[0] is Status.INVALID_MUTANT


def test_a_missing_report_is_a_harness_error() -> None:
    assert judge_failure(execution((TARGET,), probe=False), FILES, ())[0] is Status.HARNESS_ERROR


def test_the_reported_position_is_the_targets_innermost_line() -> None:
    error = run_error(execution((PROBE, INJECTED, ELSEWHERE)).exception)
    assert error == RunError(kind="ValueError", message="no", place="car/radar.py:2")
    assert run_error(None) is None
