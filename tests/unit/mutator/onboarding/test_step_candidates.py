"""How the harness guesses a controller's step function and useful places for faults."""

import ast

import pytest

from mutator.onboarding.source_survey import SourceModule, SourceSurvey
from mutator.onboarding.step_candidates import (
    StepCandidate,
    group_by_function_name,
    list_step_candidates,
)

CAR = '''
class World:
    def advance(self, gas):
        self.speed = self.speed + gas
        return self.speed


class SpeedController:
    def __init__(self, gain, *, limit, start=0.0):
        self.gain, self.limit = gain, limit
        self.i = start
        self.last = 0.0

    def update(self, speed, wanted, *, dt, trim=0.0):
        """Gas for a speed."""
        error = wanted - speed
        self.i += error * dt
        gas = self.gain * error + self.i
        if gas > self.limit:
            gas = self.limit
        label = f"{gas} of {self.limit}"
        self.log[0] = gas - 1
        self._seen = gas + 1
        state, other = gas, error
        return gas

    @property
    def control(self):
        x = 1 + 1
        return x

    def _step(self):
        x = 2 * 3
        return x


def clip(x):
    low = min(x, 1.0)
    return low


def run(controller, world):
    for _ in range(10):
        world.advance(controller.update(world.speed, 3.0, dt=0.1))
'''


def candidates(**sources: str) -> tuple[StepCandidate, ...]:
    modules = tuple(SourceModule(path=f"{name}.py", tree=ast.parse(text)) for name, text in sources.items())
    return list_step_candidates(SourceSurvey(root=None, packages=(), modules=modules))  # type: ignore[arg-type]


def test_the_controllers_step_ranks_first() -> None:
    first, *others = candidates(car=CAR)
    assert (first.name, first.path, first.line) == ("SpeedController.update", "car.py", 14)
    assert {one.name for one in others} == {"World.advance", "clip", "run"}


def test_required_arguments_are_listed() -> None:
    first, *_ = candidates(car=CAR)
    assert first.required_arguments == ("speed", "wanted", "dt")
    assert first.constructor_arguments == ("gain", "limit")


def test_only_numbers_with_a_name_are_listed_as_values() -> None:
    first, *_ = candidates(car=CAR)
    assert [(value.name, value.line, value.nth) for value in first.values] == [
        ("error", 16, None),
        ("self.i", 17, None),
        ("self._seen", 23, None),
        ("gas", 18, 1),
        ("gas", 20, 2),
    ]


def test_values_of_inner_functions_are_left_out() -> None:
    (step,) = candidates(
        a="def step(x):\n    def inner():\n        deep = x + 1\n    while x:\n        x = x - 1\n    try:\n"
        "        y = abs(x)\n    except ValueError:\n        z = x * 2\n    return inner\n"
    )
    assert {value.name for value in step.values} == {"x", "y", "z"}


def test_a_function_in_a_file_named_like_a_controller_ranks_first() -> None:
    source = "def step(x):\n    y = x + 1\n    return y\n"
    assert [one.path for one in candidates(a=source, pilot=source)] == ["pilot.py", "a.py"]


@pytest.mark.parametrize(
    "source",
    [
        "",
        "x = 1\n",
        "def step(x):\n    '''Only words.'''\n",
        "class A:\n    pass\n",
    ],
)
def test_modules_without_a_step_have_no_candidate(source: str) -> None:
    assert candidates(a=source) == ()


LAW = """
class {name}:
    {kind}def update(self, x):
        {body}
"""


def test_async_steps_are_candidates_but_async_generators_are_not() -> None:
    """`asyncio.run` can run the former only."""
    body = "u = 2.0 * x\n        return u"
    awaited = candidates(a=LAW.format(name="Control", kind="async ", body=body))
    assert [(candidate.name, candidate.is_async) for candidate in awaited] == [("Control.update", True)]
    assert candidates(a=LAW.format(name="Control", kind="async ", body="u = 2.0 * x\n        yield u")) == ()


def test_a_tie_is_decided_by_what_a_function_computes_not_by_its_file() -> None:
    """A monorepo has many equal scores; the alphabet says nothing."""
    plain = LAW.format(name="Control", kind="", body="u = x[0]\n        return u")
    computed = LAW.format(name="Control", kind="", body="u = 2.0 * x\n        return u")
    first, second = candidates(a=plain, z=computed)
    assert first.score == second.score
    assert first.path == "z.py"


def test_candidates_of_one_name_are_one_group() -> None:
    """Otherwise the `update` of each of thirty controllers would fill the list."""
    body = "u = 2.0 * x\n        return u"
    several = candidates(
        a=LAW.format(name="A", kind="", body=body),
        b=LAW.format(name="B", kind="", body=body),
        c="def drive(x):\n    u = 2.0 * x\n    return u\n",
    )
    groups = [[each.name for each in group] for group in group_by_function_name(several)]
    assert sorted(groups) == [["A.update", "B.update"], ["drive"]]
