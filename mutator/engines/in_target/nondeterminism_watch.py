"""Note lines of a tree that read a clock, draw random numbers without a seed, start a thread, or use a value
that differs between processes.

Standard library and numpy only. Functions are replaced before the target imports them, so results of watched
runs are not used. The noted line is the innermost one of the tree on the stack, even if a library made the
call. Calls made during the import of a library are ignored.
"""

import builtins
import datetime
import importlib.util
import os
import random
import secrets
import sys
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from functools import partial, update_wrapper
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

_spec = importlib.util.spec_from_file_location("thread_names", Path(__file__).with_name("thread_names.py"))
assert _spec and _spec.loader
thread_names: Any = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(thread_names)

CLOCK, DRAW, THREAD, HASH, PROCESS = "clock", "draw", "thread", "hash", "process"
_MOST_NOTED_LINES = 200  # enough to find the causes; a list of thousands hides them
_CLOCK_FUNCTIONS = ("time", "monotonic", "perf_counter", "process_time", "thread_time", "clock_gettime")
_CLOCK_FUNCTIONS_WITHOUT_TIME = (
    "localtime",
    "gmtime",
    "strftime",
    "ctime",
)  # functions that read a clock unless a time is passed
_IMPORT_SYSTEM_PREFIX = "<frozen importlib"
_INSTALLED_FOLDER = f"{os.sep}site-packages{os.sep}"


class NondeterminismWatcher:
    """Watches the tree at `tree` after `begin`."""

    def __init__(self, tree: str) -> None:
        self._tree_prefix = tree + os.sep
        self.calls_by_line: dict[tuple[str, int], dict[str, Any]] = {}
        self._other_threads: set[str] = set()
        self._is_quiet = False
        self._seeded_generators: set[Any] = set()  # shared generators that have a seed

    def begin(self) -> None:
        self._watch_numpy()  # first, because watching numpy can use `secrets`
        for name in _CLOCK_FUNCTIONS:
            for timed_name in (name, f"{name}_ns"):
                self._watch_function(time, timed_name, CLOCK, f"time.{timed_name}() reads the clock")
        for name in _CLOCK_FUNCTIONS_WITHOUT_TIME:
            self._watch_function(time, name, CLOCK, f"time.{name}() reads the clock", _has_no_time_argument)
        self._watch_function(os, "times", CLOCK, "os.times() reads the clock")
        self._watch_dates()
        self._watch_function(os, "urandom", DRAW, "os.urandom() draws from the system")
        setattr(random, "_urandom", os.urandom)  # noqa: B010
        for name in ("uuid1", "uuid4"):
            self._watch_function(uuid, name, DRAW, f"uuid.{name}() returns a different id in each run")
        for name in ("token_bytes", "token_hex", "token_urlsafe", "choice", "randbelow", "randbits"):
            self._watch_function(secrets, name, DRAW, f"secrets.{name}() draws from the system")
        self._watch_function(os, "getpid", PROCESS, "os.getpid() differs in each run", direct=True)
        self._watch_function(
            builtins, "hash", HASH, "hash() of text depends on PYTHONHASHSEED", _has_salted_hash, direct=True
        )
        self._watch_function(
            builtins, "id", PROCESS, "id() is an address, which differs in each run", direct=True
        )
        self._watch_thread_starts()
        self._watch_shared_generator(random, random._inst, "random")
        self._watch_unseeded_generators(random.Random)

    def note_call(self, kind: str, description: str, *, direct: bool = False) -> None:
        """Note the innermost line of the tree on the stack; with `direct`, only if it made the call."""
        frame: FrameType | None = sys._getframe()
        here, via = sys._getframe().f_code.co_filename, ""
        while frame is not None and frame.f_code.co_filename == here:
            frame = frame.f_back
        while frame is not None:
            file = frame.f_code.co_filename
            if file.startswith(self._tree_prefix):
                break
            if direct or file.startswith(_IMPORT_SYSTEM_PREFIX):
                return
            if _INSTALLED_FOLDER in file and not via:
                via = f"{file.rpartition(_INSTALLED_FOLDER)[2]}:{frame.f_lineno}"
            frame = frame.f_back
        if frame is None or self._is_quiet or len(self.calls_by_line) >= _MOST_NOTED_LINES:
            return
        file_and_line = (os.path.relpath(frame.f_code.co_filename, self._tree_prefix), frame.f_lineno)
        call = {
            "kind": kind,
            "file": file_and_line[0],
            "line": file_and_line[1],
            "function": frame.f_code.co_qualname,
        }
        self.calls_by_line.setdefault(file_and_line, call | {"what": description, "via": via})

    def watch_threads(self, probe: Any, observations: list[Any]) -> None:
        """Look for threads at observations 1, 2, 4, 8 and so on."""
        observe = probe.observe

        def observe_and_look(**values: Any) -> None:
            observe(**values)
            if not len(observations) & (len(observations) - 1):  # a power of two: looking takes time
                self._other_threads.update(thread_names.other_thread_names())

        probe.observe = observe_and_look

    def as_json(self) -> dict[str, Any]:
        names = sorted(self._other_threads.union(thread_names.other_thread_names()))
        return {"noted": list(self.calls_by_line.values()), "threads": names}

    def _watch_function(
        self,
        owner: Any,
        name: str,
        kind: str,
        description: str,
        is_noted: Callable[..., bool] = lambda *_, **__: True,
        *,
        direct: bool = False,
    ) -> None:
        """Replace a function with one that notes its caller if `is_noted` accepts the call."""
        original = getattr(owner, name, None)
        if original is None:
            return

        def before(*args: Any, **named: Any) -> None:
            if is_noted(*args, **named):
                self.note_call(kind, description, direct=direct)

        setattr(owner, name, _WatchedFunction(original, before))

    def _watch_dates(self) -> None:
        """Replace the date classes, which cannot be changed, with similar ones in a module that only the tree
        imports.

        Compiled code such as that of pandas crashes if it gets another class.
        """
        watched = ModuleType("datetime")
        vars(watched).update(vars(datetime))
        for name, methods in (("date", ("today",)), ("datetime", ("today", "now", "utcnow"))):
            original = getattr(datetime, name)
            like = _ReplacementClass(
                name, (original,), {"__module__": "datetime", "original_class": original}
            )
            for method in methods:
                # the method returns an object of the original class
                setattr(like, method, getattr(original, method))
                self._watch_function(like, method, CLOCK, f"datetime.{name}.{method}() reads the clock")
            setattr(watched, name, like)
        load = builtins.__import__

        def load_for(
            name: str,
            globals: Mapping[str, object] | None = None,
            locals: Mapping[str, object] | None = None,
            fromlist: Sequence[str] | None = (),
            level: int = 0,
        ) -> ModuleType:
            if (
                name == "datetime"
                and not level
                and str((globals or {}).get("__file__")).startswith(self._tree_prefix)
            ):
                return watched
            return load(name, globals, locals, fromlist, level)

        builtins.__import__ = load_for

    def _watch_thread_starts(self) -> None:
        original = threading.Thread.start

        def start(thread: threading.Thread) -> None:
            self.note_call(THREAD, f"starts the thread '{thread.name}'")
            original(thread)

        setattr(threading.Thread, "start", start)  # noqa: B010

    def _watch_shared_generator(self, module: Any, generator: Any, module_name: str) -> None:
        """Watch a module's functions that draw from one shared generator, until it has a seed."""
        shared = f"draws from the shared generator of {module_name}, which has no seed"
        for name in dir(module):
            original = getattr(module, name)
            if name in ("seed", "setstate", "set_state"):
                setattr(module, name, self._noting_seed(original, generator))
            elif getattr(original, "__self__", None) is generator and "state" not in name:
                unseeded = partial(self._is_unseeded, generator)
                self._watch_function(module, name, DRAW, f"{module_name}.{name}() {shared}", unseeded)

    def _is_unseeded(self, generator: Any, *_: Any, **__: Any) -> bool:
        return generator not in self._seeded_generators

    def _noting_seed(self, original: Callable[..., Any], generator: Any) -> Callable[..., Any]:
        def before(*args: Any, **named: Any) -> None:
            if any(value is not None for value in (*args[:1], *named.values())):
                self._seeded_generators.add(generator)

        return _WatchedFunction(original, before)

    def _watch_unseeded_generators(self, generator_class: Any) -> None:
        original = generator_class.seed

        def seed(generator: Any, a: Any = None, version: int = 2) -> None:
            if a is None and not isinstance(generator, random.SystemRandom):
                self.note_call(DRAW, "random.Random() is made without a seed")
            original(generator, a, version)

        generator_class.seed = seed

    def _watch_numpy(self) -> None:
        try:
            from numpy import random as drawn
            from numpy.random import bit_generator
        except ImportError:
            return
        self._watch_shared_generator(drawn, drawn.mtrand._rand, "numpy.random")
        what = "a generator of numpy.random is made without a seed"
        kind = drawn.RandomState

        def make(generator: Any, seed: Any = None) -> None:
            if seed is None:
                self.note_call(DRAW, what)
            self._is_quiet = True  # the constructor draws a seed even if it is given one
            try:
                kind.__init__(generator, seed)
            finally:
                self._is_quiet = False

        like = _ReplacementClass("RandomState", (kind,), {"__init__": make, "original_class": kind})
        for home in (drawn, drawn.mtrand):
            setattr(home, "RandomState", like)  # noqa: B010
        # all other generators without a seed get one from this function
        self._watch_function(bit_generator, "randbits", DRAW, what)


class _WatchedFunction:
    """A function with an action before each call.

    Like the built-in functions that it replaces, it does not become a method when it is a class
    attribute, and copying it returns the same object.
    """

    def __init__(self, original: Callable[..., Any], before: Callable[..., None]) -> None:
        self._original, self._before = original, before
        update_wrapper(self, original)

    def __call__(self, *args: Any, **named: Any) -> Any:
        self._before(*args, **named)
        return self._original(*args, **named)

    def __reduce__(self) -> str:
        return self._original.__name__


class _ReplacementClass(type):
    """Metaclass of a replacement class that behaves like the original."""

    original_class: type

    def __instancecheck__(cls, instance: object) -> bool:
        return isinstance(instance, cls.original_class)

    def __subclasscheck__(cls, kind: type) -> bool:
        return issubclass(kind, cls.original_class)


def _has_salted_hash(value: object) -> bool:
    return not isinstance(value, int | float)


def _has_no_time_argument(*args: Any, **_: Any) -> bool:
    return not any(isinstance(argument, int | float | tuple | time.struct_time) for argument in args)
