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
_MOST = 200  # the maximum number of noted lines
_CLOCKS = ("time", "monotonic", "perf_counter", "process_time", "thread_time", "clock_gettime")
_STILL = ("localtime", "gmtime", "strftime", "ctime")  # functions that read a clock unless a time is passed
_IMPORTING = "<frozen importlib"
_INSTALLED = f"{os.sep}site-packages{os.sep}"


class Watcher:
    """Watches the tree at `tree` after `begin`."""

    def __init__(self, tree: str) -> None:
        self._tree = tree + os.sep
        self.noted: dict[tuple[str, int], dict[str, Any]] = {}
        self._threads: set[str] = set()
        self._quiet = False
        self._seeded: set[Any] = set()  # shared generators that have a seed

    def begin(self) -> None:
        self._watch_numpy()  # first, because watching numpy can use `secrets`
        for name in _CLOCKS:
            for one in (name, f"{name}_ns"):
                self._watch(time, one, CLOCK, f"time.{one}() reads the clock")
        for name in _STILL:
            self._watch(time, name, CLOCK, f"time.{name}() reads the clock", _without_time)
        self._watch(os, "times", CLOCK, "os.times() reads the clock")
        self._watch_dates()
        self._watch(os, "urandom", DRAW, "os.urandom() draws from the system")
        setattr(random, "_urandom", os.urandom)  # noqa: B010
        for name in ("uuid1", "uuid4"):
            self._watch(uuid, name, DRAW, f"uuid.{name}() returns a different id in each run")
        for name in ("token_bytes", "token_hex", "token_urlsafe", "choice", "randbelow", "randbits"):
            self._watch(secrets, name, DRAW, f"secrets.{name}() draws from the system")
        self._watch(os, "getpid", PROCESS, "os.getpid() differs in each run", direct=True)
        self._watch(
            builtins, "hash", HASH, "hash() of text depends on PYTHONHASHSEED", _is_salted, direct=True
        )
        self._watch(builtins, "id", PROCESS, "id() is an address, which differs in each run", direct=True)
        self._watch_threads()
        self._watch_shared(random, random._inst, "random")
        self._watch_seed(random.Random)

    def note(self, kind: str, what: str, *, direct: bool = False) -> None:
        """Note the innermost line of the tree on the stack; with `direct`, only if it made the call."""
        frame: FrameType | None = sys._getframe()
        here, via = sys._getframe().f_code.co_filename, ""
        while frame is not None and frame.f_code.co_filename == here:
            frame = frame.f_back
        while frame is not None:
            file = frame.f_code.co_filename
            if file.startswith(self._tree):
                break
            if direct or file.startswith(_IMPORTING):
                return
            if _INSTALLED in file and not via:
                via = f"{file.rpartition(_INSTALLED)[2]}:{frame.f_lineno}"
            frame = frame.f_back
        if frame is None or self._quiet or len(self.noted) >= _MOST:
            return
        place = (os.path.relpath(frame.f_code.co_filename, self._tree), frame.f_lineno)
        told = {"kind": kind, "file": place[0], "line": place[1], "function": frame.f_code.co_qualname}
        self.noted.setdefault(place, told | {"what": what, "via": via})

    def look_for_threads(self, probe: Any, seen: list[Any]) -> None:
        """Look for threads at observations 1, 2, 4, 8 and so on."""
        observe = probe.observe

        def observe_and_look(**values: Any) -> None:
            observe(**values)
            if not len(seen) & (len(seen) - 1):
                self._threads.update(thread_names.others())

        probe.observe = observe_and_look

    def found(self) -> dict[str, Any]:
        names = sorted(self._threads.union(thread_names.others()))
        return {"noted": list(self.noted.values()), "threads": names}

    def _watch(
        self,
        home: Any,
        name: str,
        kind: str,
        what: str,
        counts: Callable[..., bool] = lambda *_, **__: True,
        *,
        direct: bool = False,
    ) -> None:
        """Replace a function with one that notes its caller if `counts` accepts the call."""
        original = getattr(home, name, None)
        if original is None:
            return

        def before(*args: Any, **named: Any) -> None:
            if counts(*args, **named):
                self.note(kind, what, direct=direct)

        setattr(home, name, _Watched(original, before))

    def _watch_dates(self) -> None:
        """Replace the date classes, which cannot be changed, with similar ones in a module that only the tree
        imports.

        Compiled code such as that of pandas crashes if it gets another class.
        """
        watched = ModuleType("datetime")
        vars(watched).update(vars(datetime))
        for name, methods in (("date", ("today",)), ("datetime", ("today", "now", "utcnow"))):
            original = getattr(datetime, name)
            like = _Like(name, (original,), {"__module__": "datetime", "like": original})
            for method in methods:
                # the method returns an object of the original class
                setattr(like, method, getattr(original, method))
                self._watch(like, method, CLOCK, f"datetime.{name}.{method}() reads the clock")
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
                and str((globals or {}).get("__file__")).startswith(self._tree)
            ):
                return watched
            return load(name, globals, locals, fromlist, level)

        builtins.__import__ = load_for

    def _watch_threads(self) -> None:
        original = threading.Thread.start

        def start(thread: threading.Thread) -> None:
            self.note(THREAD, f"starts the thread '{thread.name}'")
            original(thread)

        setattr(threading.Thread, "start", start)  # noqa: B010

    def _watch_shared(self, module: Any, generator: Any, named: str) -> None:
        """Watch a module's functions that draw from one shared generator, until it has a seed."""
        shared = f"draws from the shared generator of {named}, which has no seed"
        for name in dir(module):
            original = getattr(module, name)
            if name in ("seed", "setstate", "set_state"):
                setattr(module, name, self._seeding(original, generator))
            elif getattr(original, "__self__", None) is generator and "state" not in name:
                unseeded = partial(self._is_unseeded, generator)
                self._watch(module, name, DRAW, f"{named}.{name}() {shared}", unseeded)

    def _is_unseeded(self, generator: Any, *_: Any, **__: Any) -> bool:
        return generator not in self._seeded

    def _seeding(self, original: Callable[..., Any], generator: Any) -> Callable[..., Any]:
        def before(*args: Any, **named: Any) -> None:
            if any(value is not None for value in (*args[:1], *named.values())):
                self._seeded.add(generator)

        return _Watched(original, before)

    def _watch_seed(self, kind: Any) -> None:
        original = kind.seed

        def seed(generator: Any, a: Any = None, version: int = 2) -> None:
            if a is None and not isinstance(generator, random.SystemRandom):
                self.note(DRAW, "random.Random() is made without a seed")
            original(generator, a, version)

        kind.seed = seed

    def _watch_numpy(self) -> None:
        try:
            from numpy import random as drawn
            from numpy.random import bit_generator
        except ImportError:
            return
        self._watch_shared(drawn, drawn.mtrand._rand, "numpy.random")
        what = "a generator of numpy.random is made without a seed"
        kind = drawn.RandomState

        def make(generator: Any, seed: Any = None) -> None:
            if seed is None:
                self.note(DRAW, what)
            self._quiet = True  # the constructor draws a seed even if it is given one
            try:
                kind.__init__(generator, seed)
            finally:
                self._quiet = False

        like = _Like("RandomState", (kind,), {"__init__": make, "like": kind})
        for home in (drawn, drawn.mtrand):
            setattr(home, "RandomState", like)  # noqa: B010
        # all other generators without a seed get one from this function
        self._watch(bit_generator, "randbits", DRAW, what)


class _Watched:
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


class _Like(type):
    """Metaclass of a replacement class that behaves like the original."""

    like: type

    def __instancecheck__(cls, instance: object) -> bool:
        return isinstance(instance, cls.like)

    def __subclasscheck__(cls, kind: type) -> bool:
        return issubclass(kind, cls.like)


def _is_salted(thing: object) -> bool:
    return not isinstance(thing, int | float)


def _without_time(*args: Any, **_: Any) -> bool:
    return not any(isinstance(one, int | float | tuple | time.struct_time) for one in args)
