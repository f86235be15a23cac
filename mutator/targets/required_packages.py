"""The installed packages that a target needs, as PEP 508 requirements."""

from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import TYPE_CHECKING

from packaging.requirements import InvalidRequirement, Requirement

from mutator.config.yaml_sources import YamlSource

if TYPE_CHECKING:
    from mutator.targets.manifest import TargetManifest

MISSING = "not installed"


def read_requirements(texts: Sequence[str], source: YamlSource) -> tuple[Requirement, ...]:
    """Read a manifest's `requires`; MutatorError with the line of an invalid requirement."""
    found = []
    for i, text in enumerate(texts):
        try:
            found.append(Requirement(text))
        except InvalidRequirement as error:
            raise source.error(
                ("requires", i),
                f"'{text}'",
                expected="a requirement in pip's syntax, such as gymnasium>=1.0",
                remedy=f"correct it: {str(error).splitlines()[0]}",
            ) from None
    return tuple(found)


def shortcoming(wanted: Requirement) -> str:
    """Return what is wrong with a package: `not installed`, or the installed version. Empty if the package is
    installed as required, or is not needed on this platform.
    """
    if wanted.marker and not wanted.marker.evaluate({"extra": ""}):
        return ""
    try:
        version = metadata.version(wanted.name)
    except metadata.PackageNotFoundError:
        return MISSING
    fits = wanted.specifier.contains(version, prereleases=True)
    return "" if fits else f"{version}, wanted {wanted.specifier}"


def check_requirements(manifest: "TargetManifest") -> None:
    """Raise MutatorError, with the install command, if packages are missing or have wrong versions."""
    found = {wanted: problem for wanted in manifest.requires if (problem := shortcoming(wanted))}
    if found:
        first = manifest.requires.index(next(iter(found)))
        raise manifest.source.error(
            ("requires", first),
            "; ".join(f"{wanted.name}: {problem}" for wanted, problem in found.items()),
            expected=f"the packages that target {manifest.name} requires",
            remedy=pip_install(found),
        )


def pip_install(wanted: Iterable[Requirement | str]) -> str:
    return " ".join(["pip install", *(f"'{one}'" for one in wanted)])
