"""Put a mutant's code into the loaded modules of this process. Standard library only.

`mutator.engines.code_swap_planning` decides what can be swapped; this module checks that the loaded program
is the one that was analysed.
"""

import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

# attributes that lead to the function of a method, property or wrapper
_WRAPPING_ATTRIBUTES = ("__func__", "fget", "fset", "fdel", "func", "__wrapped__")


class SwapRefused(Exception):
    """The loaded program is not the one for which the swap was made."""


def install_probe(name: str, code_parts: Sequence[types.CodeType]) -> Any:
    """Load the probe module `name` from the parts of its code, as an import would."""
    package, _, last_name = name.rpartition(".")
    module = types.ModuleType(name)
    module.__file__, module.__package__ = code_parts[0].co_filename, package
    sys.modules[name] = module
    for code in code_parts:
        exec(code, vars(module))
    if package:
        setattr(sys.modules[package], last_name, module)
    return module


class LoadedFiles:
    """The names of the loaded modules, by file.

    A fork looks only here: to visit all modules, it would have to copy the memory of each.
    """

    def __init__(self) -> None:
        self._names_by_file: dict[str, list[str]] = {}
        self._newest: tuple[int, str] | None = None  # of the modules that were listed

    def update(self) -> None:
        """List the modules again if there are new ones."""
        newest = (len(sys.modules), next(reversed(sys.modules)))
        if newest != self._newest:
            self._newest, self._names_by_file = newest, {}
            for name, module in list(sys.modules.items()):
                if isinstance(file := getattr(module, "__file__", None), str):
                    self._names_by_file.setdefault(file, []).append(name)

    def other_module_of_file(self, module: types.ModuleType) -> str | None:
        """Return the name of another module that was loaded from the file of `module`."""
        names = self._names_by_file.get(getattr(module, "__file__", None) or "", ())
        return next((name for name in names if sys.modules.get(name, module) is not module), None)


def swap_code(functions: Sequence[Sequence[Any]], probe: types.ModuleType, loaded_files: LoadedFiles) -> None:
    """Replace the code of all functions (module, path, old code, new code), or of none."""
    name = probe.__name__.rpartition(".")[2]
    new_code_by_function = [
        (find_live_function(module, path, old, loaded_files), new) for module, path, old, new in functions
    ]
    for function, new in new_code_by_function:
        function.__code__ = new
        function.__globals__[name] = probe


def run_probe_value_setters(value_setters: Sequence[Sequence[Any]], probe: types.ModuleType) -> None:
    name = probe.__name__.rpartition(".")[2]
    for module, code in value_setters:
        if module not in sys.modules:
            raise SwapRefused(f"{module} is not loaded")
        names = vars(sys.modules[module])
        names[name] = probe
        exec(code, names)


def find_live_function(
    module: str, name_path: Sequence[str], code: types.CodeType, loaded_files: LoadedFiles
) -> types.FunctionType:
    """Return the only function at `name_path` with this code. SwapRefused if it is missing or running."""
    where = ".".join((module, *name_path))
    if module not in sys.modules:
        raise SwapRefused(f"{module} is not loaded")
    holder: Any = sys.modules[module]
    if other := loaded_files.other_module_of_file(holder):
        raise SwapRefused(f"the file of {module} is also loaded as {other}")
    for name in name_path[:-1]:
        holder = vars(holder).get(_mangled_name(holder, name))
        if not isinstance(holder, type):
            raise SwapRefused(f"{where} is not found")
    named = vars(holder).get(_mangled_name(holder, name_path[-1]))
    matches = {id(f): f for f in _functions_wrapped_in(named) if f.__code__ == code}
    if len(matches) != 1:
        raise SwapRefused(f"{where} is not found")
    (live,) = matches.values()
    if _count_references_to_code(live) > _REFERENCES_TO_IDLE_CODE:
        raise SwapRefused(f"{where} is running, or exists more than once")
    return live


def _count_references_to_code(function: types.FunctionType) -> int:
    """Count the references to a function's code: its own, those in this call, one for each running call."""
    code = function.__code__
    return sys.getrefcount(code)


# counted, because a call such as `getrefcount` adds a reference before Python 3.14 but not since
_REFERENCES_TO_IDLE_CODE = _count_references_to_code(types.FunctionType((lambda: 0).__code__.replace(), {}))


def _functions_wrapped_in(named: Any) -> Iterator[types.FunctionType]:
    if isinstance(named, types.FunctionType):
        yield named
    if named is not None and not isinstance(named, type):
        for name in _WRAPPING_ATTRIBUTES:
            yield from _functions_wrapped_in(getattr(named, name, None))


def _mangled_name(holder: Any, name: str) -> str:
    private = isinstance(holder, type) and name.startswith("__") and not name.endswith("__")
    return f"_{holder.__name__.lstrip('_')}{name}" if private else name


def keep_observations(probe: Any, state_holder: str, names: Sequence[str]) -> list[tuple[float, ...]]:
    """Make the probe keep its observations in the returned list: each has the time and the values of `names`.

    `state_holder` is the name of the object in which the probe keeps the time.
    """
    observe = probe.observe
    observations: list[tuple[float, ...]] = []

    def observe_and_keep(**values: Any) -> None:
        observe(**values)
        observations.append((getattr(probe, state_holder).t, *(float(values[name]) for name in names)))

    probe.observe = observe_and_keep
    return observations


def run_counting_observations(run: Any, observations: list[Any]) -> list[int]:
    """Run to the end; return the number of `observations` before each step."""
    counts = []
    while not run.done:
        counts.append(len(observations))
        run.step()
    return counts
