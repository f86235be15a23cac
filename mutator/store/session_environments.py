"""The environment of each session of a run folder: its software and machine."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from mutator._common.hashing import added_field

FileStemGlob = str
VersionDifference = str  # numpy 1.26.4, here 2.1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Blas:
    """A library of linear algebra that numpy loads, with its kernel for this processor and its threads."""

    library: str | None
    version: str | None
    kernel: str | None
    threads: int | None

    def __str__(self) -> str:
        kernel = f" ({self.kernel})" if self.kernel else ""
        return f"{self.library} {self.version}{kernel}, threads: {self.threads}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GitCloneState:
    """The commit of a git clone, and whether the folder in it had changed since."""

    commit: str
    changed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerMachine:
    """A worker on another machine."""

    worker: str
    mutator: str
    host: str
    python: str
    platform: str
    cpu: str | None
    blas: tuple[Blas, ...]
    packages: Mapping[str, str | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionEnvironment:
    """The software and machine that one session used.

    `python` and `packages` must stay the same during a run, unless the user accepts other versions
    (`accepted`). The other fields are only recorded, because golden runs show whether machines compute the
    same results.
    """

    python: str  # CPython 3.11.7
    packages: Mapping[str, str]  # versions of the harness's requirements and of all else that was used
    platform: str  # operating system, kernel, kind of processor
    cpu: str | None = None  # the processor's model
    blas: tuple[Blas, ...] = ()
    threads: Mapping[str, str] = field(default_factory=dict)  # thread settings in the target's environment
    git: Mapping[str, GitCloneState] | None = None  # the clones of mutator, library, templates and target
    records: FileStemGlob = (
        "*"  # glob of the session's files in records/, timings/ and proof/, without suffix
    )
    accepted: tuple[VersionDifference, ...] = ()  # from the previous session
    machines: tuple[WorkerMachine, ...] = added_field(())

    def __str__(self) -> str:
        return ", ".join(filter(None, (self.python, self.platform, self.cpu)))


def version_differences(
    before: SessionEnvironment, python: str, packages: Mapping[str, str | None]
) -> tuple[VersionDifference, ...]:
    """List the differences between a session's versions and the current ones: `numpy 1.26.4, here 2.1.0`."""
    texts = [] if before.python == python else [f"{before.python}, here {python}"]
    for name in sorted(before.packages.keys() | packages):
        old, new = before.packages.get(name), packages.get(name)
        if old != new:
            texts.append(f"{name} {old or 'none'}, here {new or 'none'}")
    return tuple(texts)


def describe_environments(environments: Iterable[SessionEnvironment]) -> dict[str, str]:
    """Describe the software and machines of sessions; several values are listed, oldest first."""
    texts_by_name: dict[str, dict[str, None]] = {}
    for environment in environments:
        for name, text in _describe_environment(environment).items():
            texts_by_name.setdefault(name, {})[text] = None
    return {name: ", ".join(texts) for name, texts in texts_by_name.items()}


def _describe_environment(environment: SessionEnvironment) -> dict[str, str]:
    texts = {"python": environment.python, "platform": environment.platform}
    if environment.cpu:
        texts["processor"] = environment.cpu
    if environment.blas:
        texts["BLAS"] = " and ".join(map(str, environment.blas))
    for place, state in (environment.git or {}).items():
        texts[f"git commit of {place}"] = state.commit + (" with changes" if state.changed else "")
    if environment.accepted:
        texts["other versions accepted"] = "; ".join(environment.accepted)
    return texts


def version_texts_by_package(environments: Iterable[SessionEnvironment]) -> dict[str, str]:
    versions_by_package: dict[str, dict[str, None]] = {}
    for environment in environments:
        for name, version in environment.packages.items():
            versions_by_package.setdefault(name, {})[version] = None
    return {name: ", ".join(versions) for name, versions in sorted(versions_by_package.items())}
