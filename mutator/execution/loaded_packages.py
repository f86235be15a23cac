"""The packages that runs of a run folder loaded, with the versions on which their results depend."""

from collections.abc import Collection, Iterable, Mapping

from mutator.campaigns import run_environment
from mutator.execution.golden_facts import GoldenFacts
from mutator.mutants.mutant_building import Mutant
from mutator.store.preflight_results import (
    packages_loaded_by_golden_runs,
    unpackaged_modules_of_golden_runs,
)
from mutator.store.run_folder import RunFolder


class LoadedPackages:
    """`version_by_package` has all installed packages whose version tells what their code is."""

    def __init__(self, folder: RunFolder, version_by_package: Mapping[str, str | None]) -> None:
        self._run_path = folder.path
        self._version_by_package = version_by_package
        self._golden_packages: tuple[str, ...] | None = None  # not read yet
        self._is_golden_unpackaged: bool | None = None
        self._added_packages: set[str] = set()  # of golden runs that checks.json does not name yet
        self._is_added_unpackaged = False

    def note_new_goldens(self) -> None:
        """Note that the run folder has more golden runs, which can have loaded more packages."""
        self._golden_packages = self._is_golden_unpackaged = None

    def add_goldens(self, facts: GoldenFacts) -> None:
        """Add golden runs that checks.json does not name yet."""
        self._added_packages |= {*facts.packages}
        self._is_added_unpackaged |= bool(facts.modules_without_package)

    def have_versions(self, version_by_package: Mapping[str, str | None]) -> bool:
        """Whether these packages have these versions here."""
        return self._versions_of(version_by_package) == version_by_package

    def versions(self, third_party_modules: Iterable[str], mutant: Mutant) -> dict[str, str | None] | None:
        """Return the versions of the packages of these modules, which a run loaded, and of those that golden
        runs loaded; None if no version tells what the code of one of these modules is.
        """
        modules = _modules_outside(mutant, third_party_modules)
        packages = self._packages_of(modules)
        if self._has_unpackaged(modules) or not packages <= self._version_by_package.keys():
            return None
        return self._versions_of(packages)

    def _versions_of(self, packages: Iterable[str]) -> dict[str, str | None]:
        return {name: self._version_by_package.get(name) for name in packages}

    def _packages_of(self, modules: Collection[str]) -> set[str]:
        if self._golden_packages is None:
            self._golden_packages = packages_loaded_by_golden_runs(RunFolder(self._run_path))
        golden_packages = {*self._golden_packages, *self._added_packages}
        return golden_packages.union(run_environment.packages_of_modules(modules) if modules else ())

    def _has_unpackaged(self, modules: Collection[str]) -> bool:
        """Whether no package provides one of these modules, or one that a golden run loaded."""
        if self._is_golden_unpackaged is None:
            self._is_golden_unpackaged = bool(unpackaged_modules_of_golden_runs(RunFolder(self._run_path)))
        is_golden_unpackaged = self._is_golden_unpackaged or self._is_added_unpackaged
        return is_golden_unpackaged or bool(run_environment.modules_without_package(modules))


def _modules_outside(mutant: Mutant, modules: Iterable[str]) -> set[str]:
    return {*modules} - {path.partition("/")[0].removesuffix(".py") for path in mutant.files}
