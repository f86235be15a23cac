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

from mutator._common.files import is_disk_full_error
from mutator._common.message_text import spelling_suggestion
from mutator._common.resource_shortages import find_shortage
from mutator._common.version import DISTRIBUTION
from mutator.errors import BadAddition, InternalException, MutatorError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint, EntryPoints

_HARNESS_FOLDER = Path(__file__).parent.parent  # the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class Door:
    """One kind of addition. `addition` is its name, `type_path` the type of every object (`module:class`),
    and `entry_point_group` the group of entry points.

    The modules of the package `shipped_package` hold the shipped ones, each as an attribute named like
    `addition`, in capitals and with `_` for a space. A module's name is the name of the object, with `_` for
    `-`, and after a keyword of Python.
    """

    addition: str
    entry_point_group: str
    type_path: str
    shipped_package: str | None = None
    api_argument: str | None = None  # the API's argument that names one; None if only files do
    names_sorted_first: tuple[str, ...] = ()  # these come before all others, in this order

    @property
    def attribute_in_module(self) -> str:
        """The name of the object in a shipped module."""
        return self.addition.upper().replace(" ", "_")

    def shipped_names(self) -> tuple[str, ...]:
        """Return the names of the shipped objects."""
        return (
            tuple(sorted(_shipped_names(self.shipped_package), key=self.sort_key))
            if self.shipped_package
            else ()
        )

    def installed_names(self) -> tuple[str, ...]:
        """Return the names that other packages add."""
        return tuple(sorted({point.name for point in _entry_points(self.entry_point_group)}))

    def names(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys((*self.shipped_names(), *self.installed_names())))

    def sort_key(self, name: str) -> tuple[int, str]:
        """Return a key that sorts names."""
        return self.names_sorted_first.index(name) if name in self.names_sorted_first else len(
            self.names_sorted_first
        ), name

    def has_name(self, name: str) -> bool:
        return name in self.shipped_names() or name in self.installed_names()

    def load(self, name: str) -> Any:
        """Return the object of that name.

        MutatorError for an unknown name, a name that two packages use, an entry point that cannot be loaded,
        or an object of another kind.
        """
        points = list(_entry_points(self.entry_point_group).select(name=name))
        is_shipped = name in self.shipped_names()
        if len(points) + is_shipped > 1:
            owners = ["mutator"] * is_shipped + [_package_and_version(point) for point in points]
            raise self._name_error(
                name, f"{self.addition} '{name}' comes from {' and '.join(owners)}", "uninstall all but one"
            )
        if self.shipped_package and is_shipped:
            return _load_shipped(self.shipped_package, self.attribute_in_module, name)
        if not points:
            remedy = "correct the name, or install the package that adds it"
            raise self._name_error(
                name, f"no {self.addition} '{name}'", remedy + spelling_suggestion(name, list(self.names()))
            )
        return self._load_entry_point(points[0])

    def _load_entry_point(self, point: "EntryPoint") -> Any:
        what = f"{self.addition} '{point.name}' of package {_package_and_version(point)} ({point.value})"
        remedy = "correct, update or uninstall this package"
        try:
            loaded = point.load()
        except Exception as err:  # importing it runs the code of somebody else
            why = f"{type(err).__name__}: {err}"
            raise MutatorError(f"{what} cannot be loaded: {why}", remedy=remedy) from err
        if not isinstance(loaded, resolve_name(self.type_path)):
            kind = self.type_path.replace(":", ".")
            raise MutatorError(
                f"{what} is of type {type(loaded).__name__}", expected=f"a {kind}", remedy=remedy
            )
        return loaded

    def other_package_of(self, name: str) -> str | None:
        """Return the package that adds that name; None if the harness does, or nobody."""
        return next((point.dist.name for point in self._entry_points_of_others(name) if point.dist), None)

    @contextmanager
    def blaming_package(self, name: str) -> Iterator[None]:
        """Raise BadAddition for an exception in code of that name, if another package adds it. What the
        harness raises itself, and errors of a machine that is out of something, stay as they are.
        """
        try:
            yield
        except (MutatorError, InternalException):
            raise
        except Exception as err:
            if (
                find_shortage(err)
                or is_disk_full_error(err)
                or (failure := self.other_package_error(name, err)) is None
            ):
                raise
            raise failure from err

    def other_package_error(self, name: str, err: Exception) -> BadAddition | None:
        """Return the error that blames another package for an exception in what it adds under that name;
        None if the harness adds it.
        """
        packages = [_package_and_version(point) for point in self._entry_points_of_others(name)]
        if not packages:
            return None
        where, line = next(_lines_outside_harness(err), (None, None))
        return BadAddition(
            f"{self.addition} '{name}' of package {packages[0]} fails: {type(err).__name__}: {err}",
            where=where,
            line=line,
            remedy="correct or remove the package",
        )

    def _entry_points_of_others(self, name: str) -> "list[EntryPoint]":
        points = _entry_points(self.entry_point_group).select(name=name)
        return [point for point in points if not (point.dist and point.dist.name == DISTRIBUTION)]

    def _name_error(self, name: str, got: str, remedy: str) -> MutatorError:
        others = ", ".join(other for other in self.names() if other != name)
        expected = f"one of {others}" if others else f"no {self.addition}, because none is installed"
        return MutatorError(got, argument=self.api_argument, expected=expected, remedy=remedy)


@cache
def _shipped_names(folder: str) -> tuple[str, ...]:
    path = _HARNESS_FOLDER.joinpath(*folder.split(".")[1:])  # without importing the package
    return tuple(module.name.rstrip("_").replace("_", "-") for module in iter_modules([str(path)]))


@cache
def _load_shipped(package: str, attribute: str, name: str) -> Any:
    module = name.replace("-", "_") + "_" * iskeyword(name)  # no module can be named `return`
    return getattr(import_module(f"{package}.{module}"), attribute)


def _entry_points(group: str) -> "EntryPoints":
    from importlib.metadata import entry_points  # takes 12 ms, a tenth of the command line's start

    return entry_points(group=group)


def _lines_outside_harness(err: Exception) -> Iterator[tuple[str, int]]:
    """Yield the files and lines of an exception that are not the harness's, from the outermost call."""
    for frame, line in walk_tb(err.__traceback__):
        file = frame.f_code.co_filename
        if not Path(file).is_relative_to(_HARNESS_FOLDER):
            yield file, line


def _package_and_version(point: "EntryPoint") -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "unknown"


EXPORT_DOOR = Door(
    addition="export",
    entry_point_group="mutator.exports",
    type_path="mutator.exports:Export",
    shipped_package="mutator.exports.formats",
    api_argument="format",
)
TRACE_IMPORTER_DOOR = Door(
    addition="importer",
    entry_point_group="mutator.importers",
    type_path="mutator.outcomes.trace_files:Importer",
    shipped_package="mutator.outcomes.importers",
    api_argument="trace",
)
LIBRARY_IMPORTER_DOOR = Door(
    addition="library importer",
    entry_point_group="mutator.library_importers",
    type_path="mutator.onboarding.library_import:LibraryImporter",
    shipped_package="mutator.paper.importers",
    api_argument="format",
)
DISTRIBUTOR_DOOR = Door(
    addition="distributor",
    entry_point_group="mutator.distributors",
    type_path="mutator.execution.distributor_choice:DistributorKind",
    shipped_package="mutator.execution.distributors",
    api_argument="cluster",
)
OPERATOR_DOOR = Door(
    addition="operator",
    entry_point_group="mutator.operators",
    type_path="mutator.operators:Operator",
    shipped_package="mutator.operators.shipped",
    api_argument="operators",
    # if two make the same change, it belongs to the first, so another order changes samples
    names_sorted_first=("arithmetic", "comparison", "constant", "branch", "omission", "return", "argument"),
)
STUDY_DOOR = Door(
    addition="study",
    entry_point_group="mutator.studies",
    type_path="mutator.report.reported_run:PublishedWork",
)
ALL_DOORS = (
    EXPORT_DOOR,
    TRACE_IMPORTER_DOOR,
    LIBRARY_IMPORTER_DOOR,
    DISTRIBUTOR_DOOR,
    OPERATOR_DOOR,
    STUDY_DOOR,
)
