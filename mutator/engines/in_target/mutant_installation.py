"""Put a mutant's code into the loaded modules of this process. Standard library only.

`mutator.engines.code_swap` decides what can be swapped; this module checks that the loaded program is the one
that was analysed.
"""

import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

# attributes that lead to the function of a method, property or wrapper
_INSIDE = ("__func__", "fget", "fset", "fdel", "func", "__wrapped__")
_OWN_REFERENCES = 3  # references to a code object: from its function, a local, an argument


class SwapRefused(Exception):
    """The loaded program is not the one for which the swap was made."""


def install(name: str, parts: Sequence[types.CodeType]) -> Any:
    """Load the probe module `name` from the parts of its code, as an import would."""
    package, _, own = name.rpartition(".")
    module = types.ModuleType(name)
    module.__file__, module.__package__ = parts[0].co_filename, package
    sys.modules[name] = module
    for code in parts:
        exec(code, vars(module))
    if package:
        setattr(sys.modules[package], own, module)
    return module


def swap_code(functions: Sequence[Sequence[Any]], probe: types.ModuleType) -> None:
    """Replace the code of all functions (module, path, old code, new code), or of none."""
    name = probe.__name__.rpartition(".")[2]
    found = [(live_function(module, path, old), new) for module, path, old, new in functions]
    for function, new in found:
        function.__code__ = new
        function.__globals__[name] = probe


def run_settings(settings: Sequence[Sequence[Any]], probe: types.ModuleType) -> None:
    name = probe.__name__.rpartition(".")[2]
    for module, code in settings:
        if module not in sys.modules:
            raise SwapRefused(f"{module} is not loaded")
        names = vars(sys.modules[module])
        names[name] = probe
        exec(code, names)


def live_function(module: str, path: Sequence[str], code: types.CodeType) -> types.FunctionType:
    """Return the only function at `path` with this code. SwapRefused if it is missing or running."""
    where = ".".join((module, *path))
    if module not in sys.modules:
        raise SwapRefused(f"{module} is not loaded")
    holder: Any = sys.modules[module]
    for name in path[:-1]:
        holder = vars(holder).get(_mangled(holder, name))
        if not isinstance(holder, type):
            raise SwapRefused(f"{where} is not found")
    named = vars(holder).get(_mangled(holder, path[-1]))
    found = {id(f): f for f in _functions(named) if f.__code__ == code}
    if len(found) != 1:
        raise SwapRefused(f"{where} is not found")
    (live,) = found.values()
    own = live.__code__
    if sys.getrefcount(own) > _OWN_REFERENCES:
        raise SwapRefused(f"{where} is running, or exists more than once")
    return live


def _functions(named: Any) -> Iterator[types.FunctionType]:
    if isinstance(named, types.FunctionType):
        yield named
    if named is not None and not isinstance(named, type):
        for name in _INSIDE:
            yield from _functions(getattr(named, name, None))


def _mangled(holder: Any, name: str) -> str:
    private = isinstance(holder, type) and name.startswith("__") and not name.endswith("__")
    return f"_{holder.__name__.lstrip('_')}{name}" if private else name


def keep_observations(probe: Any, holder: str, names: Sequence[str]) -> list[tuple[float, ...]]:
    """Make the probe keep its observations in the returned list: each has the time and the values of `names`.

    `holder` is the name of the object in which the probe keeps the time.
    """
    observe = probe.observe
    seen: list[tuple[float, ...]] = []

    def observe_and_keep(**values: Any) -> None:
        observe(**values)
        seen.append((getattr(probe, holder).t, *(float(values[name]) for name in names)))

    probe.observe = observe_and_keep
    return seen


def observations_before_steps(run: Any, seen: list[Any]) -> list[int]:
    """Run to the end; return the number of observations in `seen` before each step."""
    before = []
    while not run.done:
        before.append(len(seen))
        run.step()
    return before
