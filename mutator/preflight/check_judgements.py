"""Judges the runs of the checks before a campaign: golden runs, null mutants, anchors."""

from collections.abc import Iterable, Iterator

from mutator.campaigns import run_environment
from mutator.errors import InvalidMutant, MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Fault, GoldenClass
from mutator.mutants.mutant_building import build
from mutator.preflight.check_run_problems import (
    CheckRun,
    forked_run_problem,
    golden_pair_problem,
    null_mutant_problem,
)
from mutator.preflight.preflight_check_runner import (
    FORKED,
    GOLDEN,
    GOLDEN_AGAIN,
    NULL_MUTANT,
    CheckRunByName,
)
from mutator.store.checks_file import describe_golden_hazards
from mutator.store.golden_runs import GoldenRun
from mutator.store.preflight_results import CheckResult
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger


def golden_run_results(runs: CheckRunByName, key: GoldenRun) -> Iterator[CheckResult]:
    """Judge the two golden runs and the null mutant of a golden run."""
    first, again, null = (runs[name, key] for name in (GOLDEN, GOLDEN_AGAIN, NULL_MUTANT))
    detail, success = golden_pair_problem(first, again), "the same bytes twice"
    if first.hazards:
        success += f"; {GoldenClass.HAZARD_WITHOUT_FAULT}: {describe_golden_hazards(first.hazards)}"
    yield build_check_result(f"golden {key.key}", detail, success)
    if not first.problem:
        detail = null_mutant_problem(first, null)
        yield build_check_result(f"null mutant {key.key}", detail, "the same bytes as golden")
        if (forked := runs.get((FORKED, key))) is not None and forked is not first:
            yield build_check_result(
                f"fork {key.key}", forked_run_problem(first, forked), "the same bytes as golden"
            )


def anchor_problem(manifest: TargetManifest, models: FaultModels, faults: Iterable[Fault]) -> str:
    """Return which variants do not find their statements; empty if all do. A mutant that does not compile
    has found them.
    """
    problems: dict[str, list[str]] = {}
    for fault in faults:
        try:
            build(manifest, models, fault, always_trigger())
        except InvalidMutant:
            continue
        except MutatorError as err:
            problems.setdefault(str(err), []).append(fault.spec)
    return "; ".join(f"{', '.join(specs)}: {problem}" for problem, specs in problems.items())


def anchor_result(problem: str, variant_count: int) -> CheckResult:
    return build_check_result("anchors", problem, f"{variant_count} variants found their statements")


def loaded_packages(manifest: TargetManifest, golden_runs: Iterable[CheckRun]) -> list[str]:
    """Return the packages that golden runs loaded, without the target and the standard library."""
    return list(run_environment.packages_of_modules(_third_party_modules(manifest, golden_runs)))


def unpackaged_modules(manifest: TargetManifest, golden_runs: Iterable[CheckRun]) -> tuple[str, ...]:
    """Return the modules that golden runs loaded from outside the target and that no package provides."""
    return run_environment.modules_without_package(_third_party_modules(manifest, golden_runs))


def _third_party_modules(manifest: TargetManifest, golden_runs: Iterable[CheckRun]) -> set[str]:
    loaded = {module for run in golden_runs for module in run.third_party_modules}
    return loaded - {path.split("/")[0].removesuffix(".py") for path in manifest.tree.files}


def build_check_result(name: str, problem: str, success: str) -> CheckResult:
    return CheckResult(name=name, passed=not problem, detail=problem or success)
