"""Doors: where a module, or another package by an entry point, adds to the harness.

A door has a group of entry points and, unless packages alone add to it, a folder of modules. Each module and
each entry point has an object of the same kind. Whatever is not asked for by name is not imported. What fails
in the code of another package is blamed on that package.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from pkgutil import iter_modules, resolve_name
from traceback import walk_tb
from typing import TYPE_CHECKING, Any

from mutator._common.files import is_disk_full
from mutator._common.message_text import suggestion
from mutator._common.resource_shortages import shortage
from mutator.errors import BadAddition, MutatorError, Signal

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

_OWN = Path(__file__).parent.parent  # the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class Door:
    """One kind of addition. `thing` is its name, `kind` (`module:class`) is what every object must be, and
    `group` the group of entry points.

    The modules of the package `folder` hold the shipped ones, each as an attribute named like `thing`, in
    capitals. A module's name is the name of the object, with `_` for `-`, and after a keyword of Python.
    """

    thing: str
    group: str
    kind: str
    folder: str | None = None
    argument: str | None = None  # the API's argument that names one; None if only files do
    first: tuple[str, ...] = ()  # these come before all others, in this order

    @property
    def attribute(self) -> str:
        """The name of the object in a shipped module."""
        return self.thing.upper()

    def shipped(self) -> tuple[str, ...]:
        """Return the names of the shipped objects."""
        return tuple(sorted(_shipped(self.folder), key=self.place)) if self.folder else ()

    def installed(self) -> tuple[str, ...]:
        """Return the names that other packages add."""
        return tuple(sorted({point.name for point in _entry_points(self.group)}))

    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.shipped(), *self.installed())))

    def place(self, name: str) -> tuple[int, str]:
        """Return a key that sorts names."""
        return self.first.index(name) if name in self.first else len(self.first), name

    def has(self, name: str) -> bool:
        return name in self.shipped() or name in self.installed()

    def find(self, name: str) -> Any:
        """Return the object of that name.

        MutatorError for an unknown name, a name that two packages use, an entry point that cannot be loaded,
        or an object of another kind.
        """
        points = list(_entry_points(self.group).select(name=name))
        is_shipped = name in self.shipped()
        if len(points) + is_shipped > 1:
            owners = ["mutator"] * is_shipped + [_package(point) for point in points]
            raise self._refused(
                name, f"{self.thing} '{name}' comes from {' and '.join(owners)}", "uninstall all but one"
            )
        if self.folder and is_shipped:
            return _load_shipped(self.folder, self.attribute, name)
        if not points:
            remedy = "correct the name, or install the package that adds it"
            raise self._refused(
                name, f"no {self.thing} '{name}'", remedy + suggestion(name, list(self.names()))
            )
        return self._load(points[0])

    def _load(self, point: "EntryPoint") -> Any:
        what = f"{self.thing} '{point.name}' of package {_package(point)} ({point.value})"
        remedy = "correct, update or uninstall this package"
        try:
            loaded = point.load()
        except Exception as err:  # importing it runs the code of somebody else
            why = f"{type(err).__name__}: {err}"
            raise MutatorError(f"{what} cannot be loaded: {why}", remedy=remedy) from err
        if not isinstance(loaded, resolve_name(self.kind)):
            kind = self.kind.replace(":", ".")
            raise MutatorError(
                f"{what} is of type {type(loaded).__name__}", expected=f"a {kind}", remedy=remedy
            )
        return loaded

    def package(self, name: str) -> str | None:
        """Return the package that adds that name; None if the harness does, or nobody."""
        return next((point.dist.name for point in self._of_others(name) if point.dist), None)

    @contextmanager
    def running(self, name: str) -> Iterator[None]:
        """Raise BadAddition for an exception in code of that name, if another package adds it. What the
        harness raises itself, and errors of a machine that is out of something, stay as they are.
        """
        try:
            yield
        except (MutatorError, Signal):
            raise
        except Exception as err:
            if shortage(err) or is_disk_full(err) or (failure := self.failure(name, err)) is None:
                raise
            raise failure from err

    def failure(self, name: str, err: Exception) -> BadAddition | None:
        """Return the error that blames another package for an exception in what it adds under that name;
        None if the harness adds it.
        """
        packages = [_package(point) for point in self._of_others(name)]
        if not packages:
            return None
        where, line = next(_places_of_others(err), (None, None))
        return BadAddition(
            f"{self.thing} '{name}' of package {packages[0]} fails: {type(err).__name__}: {err}",
            where=where,
            line=line,
            remedy="correct or remove the package",
        )

    def _of_others(self, name: str) -> "list[EntryPoint]":
        points = _entry_points(self.group).select(name=name)
        return [point for point in points if not (point.dist and point.dist.name == "mutator")]

    def _refused(self, name: str, got: str, remedy: str) -> MutatorError:
        others = ", ".join(other for other in self.names() if other != name)
        expected = f"one of {others}" if others else f"no {self.thing}, because none is installed"
        return MutatorError(got, argument=self.argument, expected=expected, remedy=remedy)


@cache
def _shipped(folder: str) -> tuple[str, ...]:
    path = _OWN.joinpath(*folder.split(".")[1:])  # without importing the package
    return tuple(module.name.rstrip("_").replace("_", "-") for module in iter_modules([str(path)]))


@cache
def _load_shipped(folder: str, attribute: str, name: str) -> Any:
    module = name.replace("-", "_") + "_" * iskeyword(name)
    return getattr(import_module(f"{folder}.{module}"), attribute)


def _entry_points(group: str) -> "EntryPoints":
    from importlib.metadata import entry_points  # takes 12 ms, a tenth of the command line's start

    return entry_points(group=group)


def _places_of_others(err: Exception) -> Iterator[tuple[str, int]]:
    """Yield the files and lines of an exception that are not the harness's, from the outermost call."""
    for frame, line in walk_tb(err.__traceback__):
        file = frame.f_code.co_filename
        if not Path(file).is_relative_to(_OWN):
            yield file, line


def _package(point: "EntryPoint") -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown"


EXPORTS = Door(
    thing="export",
    group="mutator.exports",
    kind="mutator.exports:Export",
    folder="mutator.exports.formats",
    argument="format",
)
IMPORTERS = Door(
    thing="importer",
    group="mutator.importers",
    kind="mutator.outcomes.trace_files:Importer",
    folder="mutator.outcomes.importers",
    argument="trace",
)
DISTRIBUTORS = Door(
    thing="distributor",
    group="mutator.distributors",
    kind="mutator.execution.distribution:DistributorKind",
    folder="mutator.execution.distributors",
    argument="cluster",
)
OPERATORS = Door(
    thing="operator",
    group="mutator.operators",
    kind="mutator.operators:Operator",
    folder="mutator.operators.shipped",
    argument="operators",
    # if two make the same change, it belongs to the first, so another order changes samples
    first=("arithmetic", "comparison", "constant", "branch", "omission", "return", "argument"),
)
STUDIES = Door(thing="study", group="mutator.studies", kind="mutator.report.reported_run:PublishedWork")
DOORS = (EXPORTS, IMPORTERS, DISTRIBUTORS, OPERATORS, STUDIES)
