"""Targets with annotations that raise. Python 3.14 and later evaluate them only when somebody asks."""

import sys

import pytest

from mutator.engines.engine_jobs import Job, RunMode
from mutator.model import Status
from mutator.triggers.trigger_kinds import trigger_at_time

from ..fork_on_toy import Edit, Fork

pytestmark = pytest.mark.skipif(
    sys.version_info < (3, 14), reason="annotations are evaluated at once before Python 3.14"
)

SENSING = "tree/toycar/sensing.py"
DATACLASS = """

from dataclasses import dataclass


@dataclass
class Reading:
    gap: Metres = 1 / 3


def unused(a: Seconds,
    b: Seconds) -> Seconds: return a + b
"""
NESTED = """\
        gap: Metres = world.gap - Reading().gap

        def less(a: Metres, b: t"{Metres}") -> 1 / 0:
            return a - b

"""
ASKING = """\
        from annotationlib import Format, get_annotations

        get_annotations(unused, format=Format.STRING)
"""


@pytest.fixture
def annotated(fork: Fork, edit: Edit) -> Fork:
    """The toy with such annotations in a dataclass, a method, a nested function and of local variables.

    In each step it asks for the annotations of a function that it never calls.
    """
    edit(SENSING, 'world."""\n', f'world."""\n{DATACLASS}')
    edit(SENSING, "def sense(self, world):", "def sense(self, world: World) -> [][0]:")
    edit(
        SENSING,
        "closing = world.speed - world.lead_speed",
        "closing: 1 / 0 = less(world.speed, world.lead_speed)",
    )
    edit(SENSING, "        gap = world.gap\n", NESTED + ASKING)
    return fork


def test_both_engines_give_the_same_bytes(annotated: Fork) -> None:
    job = annotated.job(trigger_at_time(2.0))
    forked = annotated.engine.execute(job, annotated.folder / "work" / "forked")
    plain = annotated.engine.reference.execute(job, annotated.folder / "plain")
    assert (forked.status, forked.mode, forked.fallback_reason) == (Status.OK, RunMode.FORK, "")
    assert plain.status is Status.OK
    assert forked.probe_report == plain.probe_report is not None
    assert plain.probe_report["triggered"]
    assert (forked.out / "log.npz").read_bytes() == (plain.out / "log.npz").read_bytes()


def test_lines_of_evaluated_annotations_are_no_executed_lines(annotated: Fork) -> None:
    engine = annotated.engine
    job = Job(name="lines", scenario=annotated.toy.scenario("A"), seed=7, note_executed_lines=True)
    result = engine.reference.execute(job, annotated.folder / "lines")
    assert result.status is Status.OK, result.detail
    lines = (annotated.manifest.root / "toycar" / "sensing.py").read_text().splitlines()
    executed = [lines[number - 1] for number in result.executed_lines["toycar/sensing.py"]]
    assert "            return a - b" in executed
    assert [line for line in executed if "Seconds" in line] == []
