"""`checks.json`: the results of a run folder's preflight."""

from dataclasses import dataclass

from mutator._common.files import read_json
from mutator.errors import MutatorError
from mutator.store.checks_file import CHECKS_FILE, CHECKS_SCHEMA, UNPACKAGED_MODULES_KEY
from mutator.store.run_folder import RunFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """The result of one check: `golden S1`, `null mutant S1`, `canary`, `anchors`."""

    name: str
    passed: bool
    detail: str


def check_results(folder: RunFolder) -> tuple[CheckResult, ...]:
    """Return the results of the checks; none if they have not run."""
    path = folder.path / CHECKS_FILE
    stored = read_json(path, CHECKS_SCHEMA).get("results", ()) if path.is_file() else ()
    return tuple(CheckResult(**result) for result in stored)


def are_verdicts_provisional(folder: RunFolder) -> bool:
    """Whether experiments have begun to run, and not all checks have passed."""
    if not folder.session_environments:
        return False
    has_checks = (folder.path / CHECKS_FILE).is_file()
    return not (has_checks and all(result.passed for result in check_results(folder)))


def check_verdicts_are_final(folder: RunFolder) -> None:
    """Raise MutatorError if the verdicts are provisional."""
    if are_verdicts_provisional(folder):
        raise MutatorError(
            "its verdicts are provisional, because not all of its checks have passed",
            where=folder.path,
            expected="a run whose checks have passed",
            remedy="run the same `mutator run` command again: it goes on, or says which check fails",
        )


def packages_loaded_by_golden_runs(folder: RunFolder) -> tuple[str, ...]:
    path = folder.path / CHECKS_FILE
    return tuple(read_json(path, CHECKS_SCHEMA).get("packages", ())) if path.is_file() else ()


def unpackaged_modules_of_golden_runs(folder: RunFolder) -> tuple[str, ...]:
    """Return the modules that golden runs loaded and no package provides."""
    path = folder.path / CHECKS_FILE
    return tuple(read_json(path, CHECKS_SCHEMA).get(UNPACKAGED_MODULES_KEY, ())) if path.is_file() else ()


def golden_digests(folder: RunFolder) -> dict[str, str]:
    """Return the digest of each golden run, by its key."""
    return dict(read_json(folder.path / CHECKS_FILE, CHECKS_SCHEMA)["goldens"])


def mean_golden_run_cpu_s(folder: RunFolder) -> float | None:
    path = folder.path / CHECKS_FILE
    run_cpu_s = read_json(path, CHECKS_SCHEMA).get("run_cpu_s") if path.is_file() else None
    return run_cpu_s if isinstance(run_cpu_s, int | float) else None
