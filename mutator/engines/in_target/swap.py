"""Puts a mutant's code into the modules that are loaded in this process. Standard library only.

Only the process that runs the target imports this module. `mutator.engines.code_swap` decides what may be
exchanged; this module makes sure that what is loaded is what was looked at there.
"""

import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

_INSIDE = ("__func__", "fget", "fset", "fdel", "func", "__wrapped__")  # of methods, properties, wrappers
_OWN_REFERENCES = 3  # to a code object: its function's, a local's, an argument's


class Unfit(Exception):
    """The loaded program is not the one that the exchange was made for."""


def install(name: str, code: types.CodeType) -> Any:
    """The probe `name` (`package._fi`), loaded as an import would have."""
    package, _, own = name.rpartition(".")
    module = types.ModuleType(name)
    module.__file__, module.__package__ = code.co_filename, package
    sys.modules[name] = module
    exec(code, vars(module))
    setattr(sys.modules[package], own, module)
    return module


def exchange(functions: Sequence[Sequence[Any]], probe: Any) -> None:
    """Give each function (module, path, code it has, code it shall have) its new code."""
    found = [(function(module, path, old), new) for module, path, old, new in functions]
    for changed, new in found:
        changed.__code__ = new
        changed.__globals__["_fi"] = probe


def function(module: str, path: Sequence[str], code: types.CodeType) -> types.FunctionType:
    """The one live function at `path` in a module that has this code and is not at work."""
    where = ".".join((module, *path))
    if module not in sys.modules:
        raise Unfit(f"{module} is not loaded")
    holder: Any = sys.modules[module]
    for name in path[:-1]:
        holder = vars(holder).get(_mangled(holder, name))
        if not isinstance(holder, type):
            raise Unfit(f"{where} is not found")
    named = vars(holder).get(_mangled(holder, path[-1]))
    found = {id(f): f for f in _functions(named) if f.__code__ == code}
    if len(found) != 1:
        raise Unfit(f"{where} is not found")
    (live,) = found.values()
    own = live.__code__
    if sys.getrefcount(own) > _OWN_REFERENCES:
        raise Unfit(f"{where} is at work, or there are several of it")
    return live


def _functions(named: Any) -> Iterator[types.FunctionType]:
    """The functions that a name stands for: itself, what a method or property is made of, what is wrapped."""
    if isinstance(named, types.FunctionType):
        yield named
    if named is not None and not isinstance(named, type):
        for name in _INSIDE:
            yield from _functions(getattr(named, name, None))


def _mangled(holder: Any, name: str) -> str:
    """The name as a class has it in its dict."""
    private = isinstance(holder, type) and name.startswith("__") and not name.endswith("__")
    return f"_{holder.__name__.lstrip('_')}{name}" if private else name


def record(probe: Any) -> list[tuple[float, float, float, float]]:
    """Have the probe keep what it observes; the list that it fills."""
    observe = probe.observe
    seen: list[tuple[float, float, float, float]] = []

    def observe_and_keep(t: Any, d_rel: Any, v_ego: Any, v_lead: Any) -> None:
        seen.append((float(t), float(d_rel), float(v_ego), float(v_lead)))
        observe(t, d_rel, v_ego, v_lead)

    probe.observe = observe_and_keep
    return seen


def watched(run: Any, seen: list[Any]) -> list[int]:
    """Drive the run to its end; how much its probe had observed (`seen`) before each step."""
    before = []
    while not run.done:
        before.append(len(seen))
        run.step()
    return before
