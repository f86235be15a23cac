"""The code that injected lines call is found by following names."""

from pathlib import Path

import pytest

from mutator.review.code_called_by_injections import CalledCode
from mutator.targets.source_tree import SourceTree

TAG = "  # fi:01234567"
EYE = """\
import car.tools
import car.tools as kit
from car import numbers, weather
from .tools import clip as cut
from car.everything import *
from math import sqrt

LEVEL = 3

class Eye(Sense):
    GAIN = 2.0

    def look(self, picture, clip):
        from car.weather import Fog as Mist
        {line}
        return picture

    def lid(self):
        return cut(self.GAIN)

def helper():
    return LEVEL

class Sense:
    def feel(self):
        return helper()
"""
TREE = {
    "car/__init__.py": "from car.weather import Rain\n",
    "car/weather.py": """\
from car.base import Effect
from car.tools import clip as bounded
from numpy import ndarray

MOST: int = 9
TABLE = "drops.npz"

class Rain(Effect):
    WIDTH = MOST

    def __init__(self, amount: Fog):
        self.amount = self.limited(amount)

    def limited(self, amount):
        return bounded(amount)

class Fog:
    def apply(self, picture):
        bounded = [clip for clip in picture]
        return bounded, TABLE

class Never:
    pass
""",
    "car/base.py": "class Effect:\n    def apply(self):\n        return 1\n",
    "car/tools.py": """\
def clip(value):
    from car import numbers
    return numbers.one(value)

@cached
def never():
    return clip
""",
    "car/numbers.py": "one = two = lambda x: x\none = sorted\n",
    "car/everything.py": "from car.numbers import *\nfrom car.everything import *\n",
    "car/drops.npz": "\0",
}
RAIN = {
    "car/base.py Effect",
    "car/numbers.py one",
    "car/tools.py clip",
    "car/weather.py MOST",
    "car/weather.py Rain",
}


def called(line: str, tag: str = TAG, **changed: str) -> dict[str, str]:
    pristine = EYE.format(line="picture = picture")
    files = {**TREE, "car/eye.py": pristine, **changed}
    tree = SourceTree(Path(), {path: text.encode() for path, text in files.items()}, "", {})
    return CalledCode(tree).called_by_injected_lines("car/eye.py", EYE.format(line=line + tag).encode())


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("picture = Storm(3); from car.weather import Rain as Storm", RAIN),
        ("picture = weather.Rain(3).apply(picture)", RAIN),
        ("picture = _fi.kept('x', lambda: car.weather.Rain(3))", RAIN),
        ("picture = car.Rain(3)", RAIN),
        ("from car import numbers, weather", set()),  # imported and not used
        ("picture = str(numbers)", {"car/numbers.py"}),
        ("picture = Mist().apply(picture)", {"car/weather.py Fog", "car/weather.py TABLE", "car/drops.npz"}),
        ("picture = kit.clip(picture)", {"car/tools.py clip", "car/numbers.py one"}),
        ("picture = cut(picture)", {"car/tools.py clip", "car/numbers.py one"}),
        ("picture = two(picture)", {"car/numbers.py two"}),
        ("picture = helper()", {"car/eye.py helper", "car/eye.py LEVEL"}),
        ("picture = clip(picture)", set()),  # `clip` is an argument
        ("picture = [cut for cut in picture]", set()),
        ("picture = sqrt(picture) + len(unknown.cut)", set()),
        ("picture = picture.cut.helper()", set()),
        ("picture: Sense = 1", set()),
        (
            "self.lid()",
            {"car/eye.py Eye.lid", "car/eye.py Eye.GAIN", "car/tools.py clip", "car/numbers.py one"},
        ),
        ("self.feel()", {"car/eye.py Sense.feel", "car/eye.py helper", "car/eye.py LEVEL"}),
        ("self.unknown()", set()),
        ("picture = Sense()", {"car/eye.py Sense", "car/eye.py helper", "car/eye.py LEVEL"}),
    ],
)
def test_called_code_is_found_by_its_name(line: str, found: set[str]) -> None:
    assert set(called(line)) == found


def test_only_injected_lines_are_searched_for_calls() -> None:
    assert called("picture = weather.Rain(3)", tag="") == {}
    assert called("picture = weather.Rain(3)", tag="  # fi:observe") == {}


def test_only_the_new_value_of_a_changed_line_is_searched_for_calls() -> None:
    line = 'picture = cut(picture) + (helper() if _fi.active("01234567") else Mist())'
    was = f"{TAG} was:        picture = cut(picture) + Mist()"
    assert set(called(line, was)) == {"car/eye.py helper", "car/eye.py LEVEL"}


def test_called_source_has_all_statements_that_bind_the_name() -> None:
    assert called("kit.never()")["car/tools.py never"] == "@cached\ndef never():\n    return clip\n"
    assert called("numbers.one()")["car/numbers.py one"] == TREE["car/numbers.py"]
    assert called("Mist()")["car/drops.npz"] == "\0"


def test_unparsable_modules_and_import_cycles_call_nothing() -> None:
    assert called("picture = weather.Rain(3)", **{"car/weather.py": "class Rain(:\n"}) == {}
    assert called("picture = four()") == {}


PACKAGE = {
    "car/__init__.py": "from .weather import *\n",
    "car/sky/__init__.py": "from . import cloud\n",
    "car/sky/cloud.py": "import car.tools\n\nclass Cloud:\n    FORM = car.tools.clip(1)\n",
    "car/base.py": """\
class Effect:
    def apply(self):
        return 1

    def area(self):
        return self.width() * self.height()

    def width(self):
        return 1

    def height(self):
        return 1
""",
    "car/eye.py": """\
import car.sky
from car import Fog
from car.base import Effect

def part(picture):
    return picture

class Eye(Effect[int]):
    def apply(self):
        return super().apply()

    def width(self):
        return 2

    def look(self, picture):
        parts = [part for part in picture]
        {line}
""",
}


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("picture = Fog()", {"car/weather.py Fog", "car/weather.py TABLE", "car/drops.npz"}),
        (
            "picture = car.sky.cloud.Cloud()",
            {"car/sky/cloud.py Cloud", "car/tools.py clip", "car/numbers.py one"},
        ),
        (
            "picture = str(car.sky.cloud)",
            {"car/sky/cloud.py", "car/tools.py clip", "car/numbers.py one"},
        ),
        ("picture = super().apply()", {"car/base.py Effect.apply"}),
        ("picture = self.apply()", {"car/eye.py Eye.apply", "car/base.py Effect.apply"}),
        (
            "picture = self.area()",
            {"car/base.py Effect.area", "car/eye.py Eye.width", "car/base.py Effect.height"},
        ),
        ("picture = part(picture)", {"car/eye.py part"}),
    ],
)
def test_names_are_followed_through_packages_and_bases(line: str, found: set[str]) -> None:
    pristine = PACKAGE["car/eye.py"].format(line="pass")
    files = {**TREE, **PACKAGE, "car/eye.py": pristine}
    tree = SourceTree(Path(), {path: text.encode() for path, text in files.items()}, "", {})
    mutated = PACKAGE["car/eye.py"].format(line=line + TAG).encode()
    assert set(CalledCode(tree).called_by_injected_lines("car/eye.py", mutated)) == found


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        (["picture - LEVEL", "helper()"], {"car/eye.py LEVEL", "car/eye.py helper"}),
        (["Mist(clip)"], {"car/weather.py Fog", "car/weather.py TABLE", "car/drops.npz"}),
        (["self.GAIN"], {"car/eye.py Eye.GAIN"}),
        (["left out"], set()),
    ],
)
def test_names_in_expressions_are_resolved_in_their_function(texts: list[str], found: set[str]) -> None:
    files = {**TREE, "car/eye.py": EYE.format(line="pass")}
    tree = SourceTree(Path(), {path: text.encode() for path, text in files.items()}, "", {})
    assert set(CalledCode(tree).called_by_expressions("car/eye.py", "Eye.look", texts)) == found
