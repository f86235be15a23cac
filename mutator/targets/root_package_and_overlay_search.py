"""Find a target's root (a folder, the shipped controller, an installed package), packages and overlay."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from packaging.requirements import Requirement

from mutator._common.confined_files import is_inside
from mutator._common.shipped_files import SHIPPED_TARGET_ROOT, shipped_folder
from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.required_packages import pip_install_command

INSTALLED_PREFIX = "installed:"  # prefix of an import package's name, as `root` of a manifest


def find_root(root: str, source: YamlSource, requires: Sequence[Requirement]) -> Path:
    """Find the folder that a manifest's `root` names; it might not exist. An installed package is not
    imported.
    """
    if root == SHIPPED_TARGET_ROOT:
        return shipped_folder() / "target"
    if not root.startswith(INSTALLED_PREFIX):
        return source.path.parent / root
    name = root.removeprefix(INSTALLED_PREFIX)
    if not name.isidentifier():
        raise source.error(
            ("root",), f"'{root}'", expected=f"{INSTALLED_PREFIX} and the name of an import package"
        )
    place = find_installed_package(name)
    if place is None:
        raise source.error(
            ("root",),
            f"no package or module '{name}' is installed here",
            expected="one that this Python can import, in a folder of that name or a .py file",
            remedy=pip_install_command(requires or [name]),
        )
    return place.parent


def find_overlay(overlay: str | None, source: YamlSource) -> Path | None:
    path = source.path
    if overlay is None:
        return None
    for folder in (path.parent / overlay, path.parent.parent / overlay):
        if not is_inside(path.parent.parent, folder):
            raise source.error(
                ("overlay",),
                f"'{overlay}' leads out of the library",
                expected=f"a folder in {path.parent.parent}, because its files become part of the tree",
                remedy="put the glue into the library",
            )
        if folder.is_dir():
            return folder.resolve()
    raise source.error(
        ("overlay",),
        f"no folder {path.parent / overlay}",
        expected="a folder of glue, relative to this file or to the library",
        remedy="correct `overlay`, or make the folder",
    )


def checked_package_names(
    package: str | None, packages: Sequence[str] | None, source: YamlSource
) -> tuple[str, ...]:
    """Read the target's packages and modules, without duplicates."""
    if (package is None) == (packages is None):
        raise source.error(
            ("packages",),
            "neither `package` nor `packages`" if package is None else "both `package` and `packages`",
            expected="one of them",
            remedy="list several packages or modules under `packages`, or name a single package as `package`",
        )
    if package is not None:
        if not package.isidentifier():
            raise source.error(
                ("package",),
                f"'{package}'",
                expected="a Python package's name",
                remedy="write it as `import` does",
            )
        return (package,)
    names = tuple(packages or ())
    if not names:
        raise source.error(
            ("packages",),
            "[]: the target has no package and no module, so nothing of it could be imported or changed",
            expected="the import packages (`pilot`) and modules (`pilot.py`) of the controller in `root`",
            remedy="name them, or correct `root`",
        )
    used_names = {PROBE_MODULE_NAME}
    for i, name in enumerate(names):
        stem = name.removesuffix(".py")
        if not stem.isidentifier() or stem in used_names:
            raise source.error(
                ("packages", i),
                f"'{name}'",
                expected="a package, or a module's file such as drive.py, each once, and not "
                f"{PROBE_MODULE_NAME}",
                remedy="correct the name; do not list modules that are inside a package",
            )
        used_names.add(stem)
    return names


def check_only_installed_package(
    root: str, packages: Sequence[str], files: Sequence[str], source: YamlSource
) -> None:
    """Raise MutatorError if the tree would contain files outside an installed package."""
    name = root.removeprefix(INSTALLED_PREFIX)
    if name == root:
        return
    for package in packages:
        if package.removesuffix(".py") != name:
            raise source.error(
                ("packages",) if "packages" in source.data else ("package",),
                f"'{package}' outside {root}",
                expected=f"'{name}' alone: other files there belong to other packages",
                remedy="leave it out; put your own files into an `overlay`",
            )
    for i, glob in enumerate(files):
        if glob != f"{name}.py" and not glob.startswith(f"{name}/"):
            raise source.error(
                ("files", i), f"'{glob}' outside {root}", expected=f"globs that begin with {name}/"
            )


def find_installed_package(name: str) -> Path | None:
    """Return the folder or file of an import package or module; None if it has no single place on disk."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    folders = list(spec.submodule_search_locations or ())
    places = [Path(place) for place in folders or [spec.origin or ""]]
    existing = [place for place in places if place.name in (name, f"{name}.py") and place.exists()]
    return existing[0] if len(existing) == len(places) == 1 else None
