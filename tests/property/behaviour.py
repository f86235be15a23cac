"""Record what a generated module does, so that two runs can be compared."""

import contextlib
import io
import sys
import types
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

MOST_STEPS = 1000


def behaviour(data: bytes) -> object:
    run = _Run()
    names: dict[str, Any] = {
        "T": run.trace,
        "call": run.call,
        "Box": Box,
        "box": Box(),
        "deco": _Decorator(run.seen),
        "context": _Context(run.seen),
        "later": _Later(),
    }
    package = types.ModuleType("pack")
    names["_fi"] = probe = types.SimpleNamespace(active=lambda name: False, steps=lambda: 0)
    package.__dict__["_fi"] = probe
    out = io.StringIO()
    with mock.patch.dict(sys.modules, {"pack": package}), contextlib.redirect_stdout(out):
        try:
            exec(compile(data, "m.py", "exec", dont_inherit=True), names)
            end = "ended"
        except Exception as error:
            end = f"{type(error).__name__}: {error}"
    left = {name: _plain(value) for name, value in names.items() if name not in ("_fi", "__builtins__")}
    return run.seen, out.getvalue(), end, left


@dataclass(slots=True)
class _Run:
    """The trace of a run, and its number of steps, which is limited."""

    seen: list[Any] = field(default_factory=list)
    steps: int = 0

    def trace(self, key: int, value: Any) -> Any:
        self._count(1)
        self.seen.append((key, _plain(value)))
        return value

    def call(self, made: Any, *args: Any) -> int:
        self._count(10)
        try:
            if isinstance(made, type):
                names = [name for name, value in vars(made).items() if isinstance(value, types.FunctionType)]
                result: Any = [self.call(getattr(made(), name)) for name in names]
            else:
                result = _ended(made(*args))
        except Exception as error:
            result = f"{type(error).__name__}: {error}"
        self.seen.append(_plain(result))
        return result if isinstance(result, int) else 1

    def _count(self, steps: int) -> None:
        self.steps += steps
        if self.steps > MOST_STEPS:
            raise RuntimeError("too many steps")


class Box:
    """An object that accepts every attribute, item and call."""

    __match_args__ = ("n",)

    def __init__(self, n: Any = 0) -> None:
        self.n = n
        self.kept: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("n", "kept"):
            raise AttributeError(name)
        return self.__dict__.setdefault(name, Box())

    def __setitem__(self, key: str, value: Any) -> None:
        self.kept[key] = value

    def note(self, value: Any = None) -> Any:
        self.n = value
        return value

    def chain(self) -> "Box":
        return self


@dataclass(frozen=True, slots=True)
class _Decorator:
    seen: list[Any]

    def __call__(self, made: Any) -> Any:
        self.seen.append(("decorated", made.__name__))
        return made

    def some(self, *args: Any) -> "_Decorator":
        return self


@dataclass(frozen=True, slots=True)
class _Context:
    seen: list[Any]

    def __call__(self) -> "_Context":
        return self

    def __enter__(self) -> int:
        self.seen.append("entered")
        return 1

    def __exit__(self, *error: object) -> None:
        self.seen.append("left")

    async def __aenter__(self) -> int:
        return self.__enter__()

    async def __aexit__(self, *error: object) -> None:
        self.__exit__(*error)


class _Later:
    async def __call__(self, value: Any) -> Any:
        return value

    async def each(self, count: int) -> Any:
        for i in range(count):
            yield i


def _ended(result: Any) -> Any:
    if isinstance(result, types.CoroutineType):
        try:
            result.send(None)
        except StopIteration as stop:
            return stop.value
        finally:
            result.close()
    if isinstance(result, types.GeneratorType):
        return [value for value, _ in zip(result, range(5), strict=False)]
    if isinstance(result, types.AsyncGeneratorType):
        return [_ended(_next(result)) for _ in range(3)]
    return result


async def _next(values: Any) -> Any:
    return await anext(values, None)


def _plain(value: Any) -> Any:
    if isinstance(value, int | float | str | bytes | None):
        return value
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Box):
        return ["Box", _plain(value.n), sorted(value.kept)]
    return type(value).__name__
