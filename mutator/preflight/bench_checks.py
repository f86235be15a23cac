"""The checks of a bench: of each golden run once, with its null mutant, when a batch first needs it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from mutator._common import cached_folders
from mutator._common.bounded_reading import read_bounded
from mutator._common.files import json_bytes, read_json, remove_folder, write_atomic
from mutator._common.hashing import digest
from mutator.campaigns import run_environment
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import scenarios_sharing_runs
from mutator.engines.job_folder import ensure_work_folder
from mutator.engines.run_limits import measure_limits
from mutator.errors import CheckFailed, MutatorError
from mutator.model import Experiment, Fault
from mutator.preflight import preflight_cache
from mutator.preflight.check_judgements import (
    anchor_problem,
    build_check_result,
    golden_run_results,
    loaded_packages,
    unpackaged_modules,
)
from mutator.preflight.check_run_problems import golden_output_digest
from mutator.preflight.preflight_check_runner import GOLDEN, CheckRunner
from mutator.store import file_digests
from mutator.store.checks_file import (
    CHECKED_GOLDENS_KEY,
    CHECKS_FILE,
    CHECKS_SCHEMA,
    UNPACKAGED_MODULES_KEY,
    HazardTimes,
    golden_hazards_as_json,
    measured_limits_as_json,
    unpackaged_modules_as_json,
)
from mutator.store.file_digests import FileDigest
from mutator.store.golden_files import (
    GOLDEN_FOLDER,
    GoldenFolders,
    copy_golden,
    list_golden_files,
    move_golden,
    stored_golden,
)
from mutator.store.golden_runs import GoldenRun
from mutator.store.preflight_results import CheckResult
from mutator.store.run_progress import ProgressCallback
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

_CACHED_FACTS_FILE, _CACHED_FACTS_SCHEMA = "golden.json", "checked-golden/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckedGolden:
    """A golden run that passed its checks. `canary`: the check of the canary that is compared with it."""

    output_digest: str
    trace_digest: str
    cpu_s: float
    packages: tuple[str, ...]
    results: tuple[CheckResult, ...]
    canary: CheckResult | None = None
    modules_without_package: tuple[str, ...] = ()
    hazards: HazardTimes = ()

    def as_json(self) -> dict[str, Any]:
        values = asdict(self)
        unpackaged = unpackaged_modules_as_json(values.pop("modules_without_package"))
        lists = {"packages": list(self.packages), "results": list(map(asdict, self.results))}
        return values | lists | unpackaged

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> "CheckedGolden":
        results = tuple(CheckResult(**result) for result in values["results"])
        canary = CheckResult(**values["canary"]) if values["canary"] else None
        lists = {name: tuple(values.get(name, ())) for name in ("packages", UNPACKAGED_MODULES_KEY)}
        hazards = tuple((name, time) for name, time in values.get("hazards", ()))
        return cls(**{**values, **lists, "results": results, "canary": canary, "hazards": hazards})


@dataclass
class BenchChecks:
    """Checks what a bench needs. New golden runs stay in `pending_folder` until `store` moves them."""

    workspace: Workspace
    manifest: TargetManifest
    campaign: Campaign
    canary: Experiment | None
    scratch_folder: Path
    workers: int = 1
    notify: ProgressCallback = lambda progress: None
    # by its place in the cache, what passed in this process; benches that follow each other share it
    passed_goldens: dict[Path, CheckedGolden] = field(default_factory=dict)
    goldens: dict[GoldenRun, CheckedGolden] = field(default_factory=dict)
    _stored: set[GoldenRun] = field(default_factory=set)  # which of them are in the run folder
    _variants: set[str] = field(default_factory=set)
    _folders: GoldenFolders = field(default_factory=GoldenFolders)
    _digests_elsewhere: dict[GoldenRun, str] = field(default_factory=dict)  # of another machine or software

    @property
    def pending_folder(self) -> Path:
        return self.scratch_folder / "kept"

    def read(self, run: Path, golden_runs: Iterable[GoldenRun]) -> None:
        """Read what an earlier command checked; golden runs without results are checked again."""
        path = run / CHECKS_FILE
        if not path.is_file():
            return
        stored = read_json(path, CHECKS_SCHEMA)
        try:
            self._read_stored(run, stored, golden_runs)
        except (KeyError, TypeError, AttributeError) as err:
            raise MutatorError(
                f"damaged ({err!r})",
                where=path,
                expected="the checks of a bench",
                remedy="restore the file from a copy of the run folder",
            ) from None

    def _read_stored(self, run: Path, stored: Mapping[str, Any], golden_runs: Iterable[GoldenRun]) -> None:
        checked_values = stored[CHECKED_GOLDENS_KEY].items()
        checked = {key: CheckedGolden.from_json(values) for key, values in checked_values}
        for golden_run in golden_runs:
            golden = checked.get(golden_run.key)
            stored_digest = golden_output_digest(self.manifest, run / GOLDEN_FOLDER, golden_run.key)
            if golden is None or stored_digest != golden.output_digest:
                continue
            if stored["digest"] == _environment_digest():
                self.goldens[golden_run] = golden
                self._stored.add(golden_run)
            else:
                self._digests_elsewhere[golden_run] = golden.output_digest

    def check_anchors(self, faults: Iterable[Fault]) -> None:
        """Raise MutatorError for a variant that does not find its statement in the target."""
        new = {fault.spec: fault for fault in faults if fault.spec not in self._variants}
        if not new:
            return
        if problem := anchor_problem(self.manifest, self.workspace.fault_models(), new.values()):
            raise MutatorError(
                problem,
                expected="faults whose statements are in the target",
                remedy="correct the spec, or leave these experiments out",
            )
        self._variants |= new.keys()

    def check_goldens(self, golden_runs: Sequence[GoldenRun]) -> tuple[GoldenRun, ...]:
        """Check the golden runs that are not stored yet, and return them; CheckFailed if one fails."""
        new = tuple(golden_run for golden_run in golden_runs if golden_run not in self._stored)
        if not new:
            return ()
        remove_folder(self.pending_folder)
        unchecked = [golden_run for golden_run in new if not self._take_from_cache(golden_run)]
        failed = self._run_checks(unchecked) if unchecked else []
        failed += [result for result in self._equal_scenario_results(golden_runs) if not result.passed]
        failed += self._changed_golden_results(new)
        if failed:
            text = "; ".join(f"{result.name}: {result.detail}" for result in failed[:3])
            raise CheckFailed(
                f"checks failed: {text}",
                expected="golden runs and canary that pass",
                remedy="fix target, scenario or canary (`mutator check --drive` shows details); nothing of "
                "this batch was planned",
            )
        return new

    def checked_folders(self, run: Path, golden_runs: Sequence[GoldenRun]) -> Mapping[GoldenRun, Path]:
        """Check the golden runs that are not stored yet, and return where the output of each is."""
        ensure_work_folder(self.scratch_folder)
        new = self.check_goldens(golden_runs)
        self._folders = GoldenFolders(most_unpacked=len(golden_runs))  # all stay until the next call
        return {
            golden: self._folders.output_folder(
                (self.pending_folder if golden in new else run) / GOLDEN_FOLDER, golden.key
            )
            for golden in golden_runs
        }

    def _run_checks(self, new: Sequence[GoldenRun]) -> list[CheckResult]:
        """Run what is needed; note what passed, and return what failed."""
        canary_golden = self._canary_golden
        runner = self._runner(new, canary=self.canary if canary_golden in new else None)
        # a folder of its own, which the runner empties: the other one can have golden runs from the cache
        runner = replace(runner, pending_folder=self.scratch_folder / "checked")
        runs, verdict = runner.run_all(self.workers, self.notify)
        canary = build_check_result("canary", verdict.problem, verdict.success) if verdict else None
        for golden_run in new:
            first = runs[GOLDEN, golden_run]
            self.goldens[golden_run] = CheckedGolden(
                output_digest=first.output_digest,
                trace_digest=digest([first.trace_digest, first.alerts]),
                cpu_s=first.cpu_s,
                packages=tuple(loaded_packages(self.manifest, [first])),
                modules_without_package=unpackaged_modules(self.manifest, [first]),
                hazards=first.hazards,
                results=tuple(golden_run_results(runs, golden_run)),
                canary=canary if golden_run == canary_golden else None,
            )
        results = [result for golden_run in new for result in self.goldens[golden_run].results]
        failed = [result for result in (*results, *([canary] if canary else [])) if not result.passed]
        if not failed:
            for golden_run in new:
                self._move_to_pending(runner.pending_folder / GOLDEN_FOLDER, golden_run)
                self._store_in_cache(golden_run)
        return failed

    def _move_to_pending(self, golden: Path, golden_run: GoldenRun) -> None:
        move_golden(stored_golden(golden, golden_run.key), self.pending_folder / GOLDEN_FOLDER)

    def _changed_golden_results(self, new: Iterable[GoldenRun]) -> Iterator[CheckResult]:
        """Yield a failed check for each golden run that differs from the one the bench began with."""
        for golden_run in new:
            before = self._digests_elsewhere.get(golden_run, "")
            if before and self.goldens[golden_run].output_digest != before:
                problem = (
                    "differs from the one this bench began with, on another machine or with other versions"
                )
                yield build_check_result(f"golden {golden_run.key}", problem, "")

    @property
    def _canary_golden(self) -> GoldenRun | None:
        return GoldenRun.for_experiment(self.canary, several_seeds=True) if self.canary else None

    def _runner(self, golden_runs: Sequence[GoldenRun], canary: Experiment | None) -> CheckRunner:
        return CheckRunner(
            workspace=self.workspace,
            manifest=self.manifest,
            campaign=self.campaign,
            golden_runs=golden_runs,
            seed=self.campaign.seed,
            canary_experiment=canary,
            scratch_folder=self.scratch_folder,
            pending_folder=self.pending_folder,
        )

    def store(self, run: Path, golden_runs: Sequence[GoldenRun], new: Sequence[GoldenRun]) -> None:
        """Move new golden runs into the run folder, and write checks.json."""
        files: dict[str, FileDigest | None] = {}
        for golden_run in new:
            for path in list_golden_files(self._pending_golden(golden_run)):
                name = path.relative_to(self.pending_folder).as_posix()
                files[name] = FileDigest.of_bytes(read_bounded(path))
        checks = json_bytes(self._as_json(golden_runs))
        with file_digests.announcing_rewrites(run, {**files, CHECKS_FILE: FileDigest.of_bytes(checks)}):
            for golden_run in new:
                move_golden(self._pending_golden(golden_run), run / GOLDEN_FOLDER)
            write_atomic(run / CHECKS_FILE, checks)
        self._stored |= set(new)

    def _pending_golden(self, golden_run: GoldenRun) -> Path:
        return stored_golden(self.pending_folder / GOLDEN_FOLDER, golden_run.key)

    def _as_json(self, golden_runs: Sequence[GoldenRun]) -> dict[str, Any]:
        checked = [self.goldens[golden_run] for golden_run in golden_runs]
        cpu_s = [golden.cpu_s for golden in checked]
        limits = measure_limits(self.campaign.limits, self.campaign.measured_limit_names, cpu_s)
        results = [
            # without their number, which changes with every batch
            build_check_result("anchors", "", "all variants found their statements"),
            *(result for golden in checked for result in golden.results),
            *self._equal_scenario_results(golden_runs),
            *(golden.canary for golden in checked if golden.canary),
        ]
        return {
            "schema": CHECKS_SCHEMA,
            "digest": _environment_digest(),
            "results": list(map(asdict, results)),
            "goldens": {
                golden_run.key: golden.output_digest
                for golden_run, golden in zip(golden_runs, checked, strict=True)
            },
            "packages": sorted({name for golden in checked for name in golden.packages}),
            **unpackaged_modules_as_json(
                name for golden in checked for name in golden.modules_without_package
            ),
            **golden_hazards_as_json(
                {
                    golden_run.key: golden.hazards
                    for golden_run, golden in zip(golden_runs, checked, strict=True)
                }
            ),
            "run_cpu_s": sum(cpu_s) / len(cpu_s),
            CHECKED_GOLDENS_KEY: {
                golden_run.key: golden.as_json()
                for golden_run, golden in zip(golden_runs, checked, strict=True)
            },
            **measured_limits_as_json(limits),
        }

    def _equal_scenario_results(self, golden_runs: Sequence[GoldenRun]) -> list[CheckResult]:
        """Compare golden runs of scenarios that a change makes equal, according to the manifest."""
        groups: dict[GoldenRun, dict[str, CheckedGolden]] = {}
        for golden_run in golden_runs:
            is_shared = golden_run.scenario in scenarios_sharing_runs(self.manifest, golden_run.changes)
            if is_shared and golden_run in self.goldens:
                group = groups.setdefault(golden_run._replace(scenario=""), {})
                group[golden_run.scenario] = self.goldens[golden_run]
        results = []
        for golden_run, goldens in groups.items():
            differs = len({golden.trace_digest for golden in goldens.values()}) > 1
            problem = "they differ, although the manifest says that they are equal (same_in)" * differs
            name = golden_run._replace(scenario="+".join(goldens)).key
            results.append(build_check_result(f"same {name}", problem, "one run for all"))
        return results

    def _cached_path(self, golden_run: GoldenRun) -> Path:
        inputs = RunInputs.from_workspace(self.workspace, self.manifest, [golden_run.scenario])
        facts: list[Any] = [inputs.digest_by_source(), golden_run.to_stored()]
        facts.append(asdict(self.campaign.golden_run_limits))
        if golden_run == self._canary_golden and self.canary and self.campaign.canary:
            facts += [self.canary.id, self.campaign.canary.hazard]
        return preflight_cache.cached_checks_path(digest([*facts, _environment_digest()]))

    def _store_in_cache(self, golden_run: GoldenRun) -> None:
        path = self._cached_path(golden_run)

        def fill(entry: Path) -> None:
            copy_golden(self.pending_folder / GOLDEN_FOLDER, golden_run.key, entry / GOLDEN_FOLDER)
            facts = {"schema": _CACHED_FACTS_SCHEMA, **self.goldens[golden_run].as_json()}
            write_atomic(entry / _CACHED_FACTS_FILE, json_bytes(facts))

        cached_folders.store_in_cache(path, fill)
        self.passed_goldens[path] = self.goldens[golden_run]

    def _take_from_cache(self, golden_run: GoldenRun) -> bool:
        """Take over checks that passed before on this machine. The null mutant runs again, whose output must
        be the golden run's, because a mutant can write to the cache, unless this process remembers the run.
        """
        copy, path = self.scratch_folder / "cached", self._cached_path(golden_run)
        try:
            cached_folders.copy_from_cache(path, copy)
            facts = read_json(copy / _CACHED_FACTS_FILE, _CACHED_FACTS_SCHEMA)
            facts.pop("schema")
            golden = CheckedGolden.from_json(facts)
            copied_digest = golden_output_digest(self.manifest, copy / GOLDEN_FOLDER, golden_run.key)
        except (MutatorError, OSError, KeyError, TypeError, AttributeError):
            return False  # missing or damaged
        if not all(result.passed for result in golden.results):
            return False
        digests = {copied_digest, golden.output_digest}
        if self.passed_goldens.get(path) != golden:
            again = replace(self._runner([golden_run], None), pending_folder=self.scratch_folder / "again")
            repeated = again.repeat_goldens(1, self.notify)
            digests.update(run.output_digest for run in repeated.values())
        if digests != {golden.output_digest}:
            return False  # forged, or no longer true
        self._move_to_pending(copy / GOLDEN_FOLDER, golden_run)
        self.goldens[golden_run] = self.passed_goldens[path] = golden
        return True


def _environment_digest() -> str:
    return digest(run_environment.environment_affecting_results())
