"""Swapping code in loaded modules: the forms of functions, and the reasons for refusing a swap."""

import sys
import types
from collections.abc import Callable, Iterator
from functools import lru_cache, wraps  # noqa: F401 - used in LOADED

import pytest

from mutator.engines.code_swap_planning import changed_functions
from mutator.engines.in_target.mutant_installation import LoadedFiles, SwapRefused, swap_code

LOADED = """
from functools import lru_cache, wraps

def traced(function):
    @wraps(function)
    def call(*arguments):
        return function(*arguments)
    return call

def plain():
    return "old plain"

@traced
def wrapped():
    return "old wrapped"

@lru_cache
def cached(x):
    return ("old cached", x)

class Car:
    def method(self):
        return "old method"

    @staticmethod
    def static():
        return "old static"

    @classmethod
    def of(cls):
        return "old of"

    @property
    def speed(self):
        return self._speed, "old speed"

    @speed.setter
    def speed(self, value):
        self._speed = ("old setter", value)

    def __private(self):
        return "old private"

    def private(self):
        return self.__private()

    def itself(self):
        return super().__repr__() and "old itself"

def twice():
    return "old twice"
again = types.FunctionType(twice.__code__, globals())

def walk():
    return work(), "old walk"
"""
PROBE = types.ModuleType("car._fi")


@pytest.fixture
def loaded() -> Iterator[types.ModuleType]:
    module = types.ModuleType("some_loaded_car")
    vars(module)["types"] = types
    exec(compile(LOADED, "car.py", "exec", dont_inherit=True), vars(module))
    sys.modules[module.__name__] = module
    yield module
    del sys.modules[module.__name__]


def functions(old: str, new: str) -> list[tuple[str, tuple[str, ...], types.CodeType, types.CodeType]]:
    before = compile(LOADED, "car.py", "exec", dont_inherit=True)
    after = compile(LOADED.replace(old, new), "car.py", "exec", dont_inherit=True)
    return [
        ("some_loaded_car", path, one, other)
        for path, one, other in changed_functions(before, after, "car.py")
    ]


def swap(changed: list[tuple[str, tuple[str, ...], types.CodeType, types.CodeType]]) -> None:
    loaded_files = LoadedFiles()
    loaded_files.update()
    swap_code(changed, PROBE, loaded_files)


@pytest.mark.parametrize(
    ("word", "call"),
    [
        ("plain", lambda m: m.plain()),
        ("wrapped", lambda m: m.wrapped()),
        ("cached", lambda m: m.cached(1)[0]),
        ("method", lambda m: m.Car().method()),
        ("static", lambda m: m.Car.static()),
        ("of", lambda m: m.Car.of()),
        ("private", lambda m: m.Car().private()),
        ("itself", lambda m: m.Car().itself()),
        ("setter", lambda m: setattr(car := m.Car(), "speed", 1) or car.speed[0][0]),
    ],
)
def test_functions_of_every_form_run_the_new_code(
    loaded: types.ModuleType, word: str, call: Callable[[types.ModuleType], str]
) -> None:
    """The new code runs even after many calls to the old code."""
    kept = call
    for _ in range(200):
        if word != "cached":
            assert kept(loaded) == f"old {word}"
    swap(functions(f'"old {word}"', f'"new {word}"'))
    assert kept(loaded) == f"new {word}"
    assert vars(loaded)["_fi"] is PROBE


def test_imported_names_and_bound_methods_run_the_new_code(loaded: types.ModuleType) -> None:
    plain, method = loaded.plain, loaded.Car().method
    swap(functions('"old plain"', '"new plain"'))
    swap(functions('"old method"', '"new method"'))
    assert (plain(), method()) == ("new plain", "new method")


def test_another_function_with_the_same_name_is_not_swapped(loaded: types.ModuleType) -> None:
    vars(loaded)["plain"] = lambda: "mine"
    changed = functions('"old', '"new')
    with pytest.raises(SwapRefused, match=r"some_loaded_car\.plain is not found"):
        swap(changed)
    assert loaded.Car.static() == "old static"


def test_code_shared_by_two_functions_is_not_swapped(loaded: types.ModuleType) -> None:
    with pytest.raises(SwapRefused, match="exists more than once"):
        swap(functions('"old twice"', '"new twice"'))


def test_a_function_on_the_stack_is_not_swapped(loaded: types.ModuleType) -> None:
    """The function would continue with its old code."""

    def work() -> None:
        swap(functions('"old walk"', '"new walk"'))

    vars(loaded)["work"] = work
    with pytest.raises(SwapRefused, match="is running"):
        loaded.walk()


def test_a_module_that_is_not_loaded_is_not_swapped(loaded: types.ModuleType) -> None:
    changed = [("car_nobody_loaded", path, old, new) for _, path, old, new in functions('"old', '"new')]
    with pytest.raises(SwapRefused, match="car_nobody_loaded is not loaded"):
        swap(changed)


def test_a_file_that_is_loaded_twice_is_not_swapped(loaded: types.ModuleType) -> None:
    """Also if the second module came after the modules were first listed."""
    loaded.__file__ = "car.py"
    loaded_files, again = LoadedFiles(), types.ModuleType("loaded_again")
    loaded_files.update()
    assert loaded_files.other_module_of_file(loaded) is None
    again.__file__, sys.modules["loaded_again"] = loaded.__file__, again
    try:
        loaded_files.update()
        with pytest.raises(SwapRefused, match="the file of some_loaded_car is also loaded as loaded_again"):
            swap_code(functions('"old plain"', '"new plain"'), PROBE, loaded_files)
    finally:
        del sys.modules["loaded_again"]


def test_a_second_name_of_the_same_module_prevents_no_swap(loaded: types.ModuleType) -> None:
    loaded.__file__, sys.modules["another_name"] = "car.py", loaded
    try:
        swap(functions('"old plain"', '"new plain"'))
    finally:
        del sys.modules["another_name"]
    assert loaded.plain() == "new plain"
