"""The installed packages that a target needs, as PEP 508 requirements."""

from collections.abc import Iterable, Sequence
from importlib import metadata
from typing import TYPE_CHECKING

from packaging.requirements import InvalidRequirement, Requirement

from mutator.config.yaml_source_lines import YamlSource

if TYPE_CHECKING:
    from mutator.targets.manifest import TargetManifest

NOT_INSTALLED = "not installed"


def parse_requirements(texts: Sequence[str], source: YamlSource) -> tuple[Requirement, ...]:
    """Read a manifest's `requires`; MutatorError with the line of an invalid requirement."""
    requirements = []
    for i, text in enumerate(texts):
        try:
            requirements.append(Requirement(text))
        except InvalidRequirement as error:
            raise source.error(
                ("requires", i),
                f"'{text}'",
                expected="a requirement in pip's syntax, such as gymnasium>=1.0",
                remedy=f"correct it: {str(error).splitlines()[0]}",
            ) from None
    return tuple(requirements)


def installation_problem(requirement: Requirement) -> str:
    """Return what is wrong with a package: `not installed`, or the installed version. Empty if the package is
    installed as required, or is not needed on this platform.
    """
    if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
        return ""
    try:
        version = metadata.version(requirement.name)
    except metadata.PackageNotFoundError:
        return NOT_INSTALLED
    fits = requirement.specifier.contains(version, prereleases=True)
    return "" if fits else f"{version}, wanted {requirement.specifier}"


def check_requirements(manifest: "TargetManifest") -> None:
    """Raise MutatorError, with the install command, if packages are missing or have wrong versions."""
    problems = {
        requirement: problem
        for requirement in manifest.requires
        if (problem := installation_problem(requirement))
    }
    if problems:
        first = manifest.requires.index(next(iter(problems)))
        raise manifest.source.error(
            ("requires", first),
            "; ".join(f"{requirement.name}: {problem}" for requirement, problem in problems.items()),
            expected=f"the packages that target {manifest.name} requires",
            remedy=pip_install_command(problems),
        )


def pip_install_command(requirements: Iterable[Requirement | str]) -> str:
    return " ".join(["pip install", *(f"'{requirement}'" for requirement in requirements)])
