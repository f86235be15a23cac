"""What a model may use, and what it reads and commands."""

import os
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.workspace import Workspace

from .test_defence_yaml import FILE, load

METHODS = "    def reset(self): ...\n    def update(self, since_s, sensed, applied):\n        "


def write_model(toycar: Workspace, code: str) -> Path:
    path = toycar.templates / "defences" / "own.py"
    path.write_text(code)
    return path


def load_own(toycar: Workspace, text: str = FILE) -> None:
    load(toycar, text.replace("constant_command", "own"))


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("class Model:\n    def reset(self): ...\n", r"no method `update\(self, since_s, sensed, applied\)`"),
        ("import os\n", "an import of os"),
        ("from . import x\n", "an import of ."),
        ("x = open('a')\n", "the name `open`"),
        ("x = 1\n", "0 classes `Model`"),
        ("x = (\n", "not valid Python"),
        (
            "BOUNDS = [1]\nclass Model:\n    def reset(self): ...\n"
            "    def update(self, since_s, sensed, applied): ...\n",
            r"BOUNDS = \[1\]; expected first words",
        ),
        (
            "BOUNDS: list[int] = [1]\nclass Model:\n    def reset(self): ...\n"
            "    def update(self, since_s, sensed, applied): ...\n",
            r"BOUNDS = \[1\]; expected first words",
        ),
    ],
)
def test_a_file_that_is_no_model_is_refused(toycar: Workspace, code: str, message: str) -> None:
    write_model(toycar, code)
    with pytest.raises(MutatorError, match=rf"own\.py.*{message}"):
        load_own(toycar)


def test_a_missing_parameter_of_the_model_is_named(toycar: Workspace) -> None:
    code = "class Model:\n    def __init__(self, *, amount, more=1.0): ...\n    def reset(self): ...\n"
    code += "    def update(self, since_s, sensed, applied): ...\n"
    write_model(toycar, code)
    with pytest.raises(MutatorError, match=r"no parameter 'amount'; expected .* amount, more"):
        load_own(toycar)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("from dataclasses import sys\n", "`sys` of dataclasses; expected a public function"),
        ("from math import __loader__ as x\n", "`__loader__` of math"),
        ("import dataclasses\nx = dataclasses.sys.modules\n", "`sys` of dataclasses"),
        ("import statistics\nx = statistics.random.random()\n", "`random` of statistics"),
        ("import statistics as s\ny = s\nx = y.random\n", "the module statistics as a value"),
        ("import collections\nx = collections._sys\n", "`_sys` of collections"),
        ('x = __builtins__["open"]\n', "the name `__builtins__`"),
        ('import math\nx = getattr(math, "__loader__")\n', "'__loader__'; expected no text with `__`"),
        ('x = getattr(1, "re" + "al")\n', "`getattr` with a computed name"),
        ("x = ().__class__\n", "the name `__class__`"),
        ("from operator import attrgetter\n", "the name `attrgetter`"),
        ("import collections.nothing\n", "an import of collections.nothing"),
    ],
)
def test_cheap_ways_out_of_a_model_are_closed(toycar: Workspace, code: str, message: str) -> None:
    write_model(toycar, code)
    with pytest.raises(MutatorError, match=rf"own\.py:\d+: .*{message}"):
        load_own(toycar)


def test_what_a_model_needs_can_be_used(toycar: Workspace) -> None:
    """Public functions and classes, modules in modules, slots, base classes and documentation."""
    code = '''"""It has `__init__`."""
import collections.abc
import math as m
from collections import abc, deque
from dataclasses import dataclass, field
from typing import NamedTuple

class Base:
    __slots__ = ("open",)
    def __init__(self, ranges):
        self.open = deque(ranges.items(), maxlen=3)

class Model(Base):
    def __init__(self, **bounds):
        """As `__init__` of the base."""
        super().__init__(bounds)
        self.is_mapping = isinstance(bounds, abc.Mapping) and isinstance(bounds, collections.abc.Mapping)
    def reset(self): ...
    def update(self, since_s, sensed, applied):
        return {getattr(self, "command", name): (-m.inf, m.inf) for name in applied}
'''
    write_model(toycar, code)
    load_own(toycar)


def test_a_model_that_is_no_file_is_named(toycar: Workspace) -> None:
    """A pipe does not keep the reader waiting."""
    folder = toycar.templates / "defences"
    (folder / "own.py").mkdir()
    with pytest.raises(MutatorError, match=r"d\.yaml:6: .*own\.py cannot be read \(Is a directory\)"):
        load_own(toycar)
    os.mkfifo(folder / "pipe.py")
    with pytest.raises(MutatorError, match=r"d\.yaml:6: .*pipe\.py cannot be read"):
        load(toycar, FILE.replace("constant_command", "pipe"))


@pytest.mark.parametrize(
    ("update", "message"),
    [
        (
            "return {} if sensed['ttc'] else {}",
            r"d\.yaml:7: no sense or derived value 'ttc'; expected .*own\.py:",
        ),
        ("return {} if applied['horn'] else {}", r"d\.yaml:6: 'own' reads the command 'horn' \(own\.py:6\)"),
        ("return {'gas': (0.0, 0.0)}", r"d\.yaml:11: no 'gas'; expected it, because model own always"),
    ],
)
def test_a_defence_must_have_what_its_model_uses(toycar: Workspace, update: str, message: str) -> None:
    code = "class Model:\n    def __init__(self, **bounds):\n        self.bounds = bounds\n"
    write_model(toycar, f"{code}{METHODS}{update}\n")
    with pytest.raises(MutatorError, match=message):
        load_own(toycar)


@pytest.mark.parametrize(
    "update",
    [
        "return {} if 'ttc' in sensed and sensed['ttc'] else {}",
        "return {} if sensed.get('ttc', 0.0) else {}",
        "return {name: (0.0, 0.0) for name in sensed}",
    ],
)
def test_a_model_can_ask_for_what_may_be_missing(toycar: Workspace, update: str) -> None:
    code = "class Model:\n    def __init__(self, **bounds):\n        self.bounds = bounds\n"
    write_model(toycar, f"{code}{METHODS}{update}\n")
    load_own(toycar)


def test_staged_braking_needs_its_senses(toycar: Workspace) -> None:
    """What it reads is in its source."""
    names = ("stops_at_2", "stops_at_3", "deceleration_1", "deceleration_2", "deceleration_3")
    parameters = ", ".join(f"{name}: {{value: 1, unit: m/s^2}}" for name in names)
    text = FILE.replace("constant_command", "staged_braking")
    text = text.replace('lowest_brake: {value: 0.5, unit: "-"}', parameters)
    with pytest.raises(MutatorError, match=r"no sense or derived value 'ttc'; .*staged_braking\.py:\d+"):
        load(toycar, text)


def test_a_time_of_a_model_is_not_negative(toycar: Workspace) -> None:
    code = f"class Model:\n    def __init__(self, *, reaction_s, **bounds): ...\n{METHODS}return {{}}\n"
    write_model(toycar, code)
    text = FILE.replace("offset: {value: 1,", "reaction_s: {value: -2.5, unit: s}, offset: {value: -1,")
    with pytest.raises(
        MutatorError, match=r"d\.yaml:9: -2\.5 s for 'reaction_s'; expected a time, at least 0"
    ):
        load_own(toycar, text)
