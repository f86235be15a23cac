"""The checks that must pass before a campaign starts: equal golden runs, null mutants, canary, anchors."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from mutator._common import cached_folders
from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import path_below, unlink_below
from mutator._common.files import json_bytes, raising_disk_full, read_json, remove_folder, write_atomic
from mutator._common.hashing import digest
from mutator.campaigns import run_environment
from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import scenarios_sharing_runs
from mutator.engines.observation_store import ObservationStore
from mutator.errors import CheckFailed, DiskFull, MutatorError
from mutator.families.family import argument_of
from mutator.limits import Limits
from mutator.preflight import preflight_cache, unreached_triggers
from mutator.preflight.canary_check import CanaryVerdict
from mutator.preflight.check_judgements import (
    anchor_problem,
    anchor_result,
    build_check_result,
    golden_run_results,
    loaded_packages,
    unpackaged_modules,
)
from mutator.preflight.check_run_problems import (
    CheckRun,
    equal_scenarios_problem,
    golden_output_digest,
    golden_verdict_of,
)
from mutator.preflight.forked_golden_runs import describe_family_runs
from mutator.preflight.preflight_check_runner import (
    GOLDEN,
    CheckRunByName,
    CheckRunner,
    OnProgress,
)
from mutator.store import file_digests, plan_file
from mutator.store.checks_file import (
    CHECKS_FILE,
    CHECKS_SCHEMA,
    GOLDEN_HAZARDS_KEY,
    MEASURED_LIMITS_KEY,
    golden_hazards_as_json,
    measured_limits_as_json,
    unpackaged_modules_as_json,
)
from mutator.store.file_digests import FileDigest
from mutator.store.golden_files import GOLDEN_FOLDER, copy_golden, move_golden, stored_golden
from mutator.store.golden_runs import GoldenRun
from mutator.store.golden_verdicts import golden_verdicts_as_json
from mutator.store.preflight_results import CheckResult
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


def run_checks(
    workspace: Workspace,
    folder: RunFolder,
    *,
    workers: int = 1,
    notify: OnProgress | None = None,
    secret: bytes = b"",
    with_forks: bool = False,
) -> tuple[CheckResult, ...]:
    """Run the checks, and store the results in checks.json and the golden runs in the folder.

    Nothing runs if the checks have passed for these sources in this folder. If they have passed in another
    folder on this machine, only the null mutants run, whose output must be that of the golden runs, because a
    mutant can write to the cache. Fork engines with the same `secret` take from the null mutants what these
    observe. `with_forks`: drive most golden runs of families once, in a fork. Raises CheckFailed if any check
    fails, after all have run.
    """
    checks = PreflightChecks(workspace, folder, secret, with_forks=with_forks)
    notify = notify or (lambda progress: None)
    earlier_results = checks.find_earlier_results(workers, notify)
    if earlier_results is not None:
        return earlier_results
    with raising_disk_full(folder.path):
        results = tuple(checks.run(workers, notify))
    raise_if_failed(folder, results)
    checks.store_in_cache()
    return results


def raise_if_failed(folder: RunFolder, results: Sequence[CheckResult]) -> None:
    """Raise CheckFailed if any check has failed."""
    failed = [result for result in results if not result.passed]
    if failed:
        text = "; ".join(f"{result.name}: {result.detail}" for result in failed[:3])
        raise CheckFailed(
            f"{len(failed)} of {len(results)} checks before the campaign failed: {text}",
            where=folder.path / CHECKS_FILE,
            remedy="fix target, templates or canary (`mutator check --drive` shows details); a campaign "
            "has results only if all pass",
        )


def describe_unreached_triggers(workspace: Workspace, folder: RunFolder) -> list[str]:
    """Remarks on triggers of the plan that no golden run reaches; none unless the golden runs just ran or
    were cached. What is left out does not matter.
    """
    left_out = folder.left_out_goldens
    keyed = ((folder.golden_run_of(e).key, e) for e in plan_file.iterate_experiments(folder.path))
    experiments = ((key, experiment) for key, experiment in keyed if key not in left_out)
    observed = unreached_triggers.load_observations(_pending_folder(folder))
    manifest = workspace.manifest_of(folder.head)
    return (
        unreached_triggers.describe_unreached(workspace, manifest, experiments, observed) if observed else []
    )


def checks_and_goldens_exist(folder: RunFolder) -> bool:
    stored = [
        stored_golden(folder.path / GOLDEN_FOLDER, golden_run.key) for golden_run in folder.goldens_with_files
    ]
    files = [path_below(run, name) for run in stored if run.is_dir() for name in folder.head.golden_files]
    return all(map(Path.exists, stored)) and all(map(Path.is_file, (folder.path / CHECKS_FILE, *files)))


def _pending_folder(folder: RunFolder) -> Path:
    """Return the folder that keeps golden runs until they are accepted. Their observations stay there."""
    return folder.scratch_folder / "kept"


class PreflightChecks:
    def __init__(
        self, workspace: Workspace, folder: RunFolder, secret: bytes, *, with_forks: bool = False
    ) -> None:
        head = folder.head
        self.observation_store = ObservationStore(folder.scratch_folder, secret) if secret else None
        self.workspace = workspace.with_scenarios_of(folder.path)
        self.folder = folder
        self.pending_folder = _pending_folder(folder)
        self.manifest: TargetManifest = workspace.manifest_of(head)
        self.models = workspace.fault_models()
        self.golden_runs = folder.golden_runs
        self.campaign = load_campaign_of_run(folder)
        now = RunInputs.of_run(workspace, folder).digest_by_source()
        self.fault_by_variant = {fault.spec: fault for fault in plan_file.load_faults(folder.path).values()}
        places = sorted(
            (name, [i.location for i in f.injections]) for name, f in self.fault_by_variant.items()
        )
        content = [
            now,
            run_environment.environment_affecting_results(),
            [golden_run.to_stored() for golden_run in self.golden_runs],
            head.seed,
            folder.canary.id if folder.canary else "",
            head.canary_hazard,
            _limits_that_checks_depend_on(self.campaign),
        ]
        self._with_forks = with_forks and self.workspace.planned_scenarios is not None
        self.digest = digest([*content, places, *(["with forks"] if self._with_forks else [])])

    def find_earlier_results(self, workers: int, notify: OnProgress) -> tuple[CheckResult, ...] | None:
        """Earlier results, copied from another folder if necessary; None unless all checks passed and the
        golden runs are unchanged.
        """
        if (results := self._passed_results(self._stored_checks(), self.folder.path)) is not None:
            return results
        if not self._can_use_cache:
            return None
        copy = self.pending_folder
        try:
            with raising_disk_full(copy):
                cached_folders.copy_from_cache(preflight_cache.cached_checks_path(self.digest), copy)
            stored = read_json(copy / CHECKS_FILE, CHECKS_SCHEMA)
            results = self._passed_results(stored, copy)
        except DiskFull:
            raise
        except (MutatorError, OSError, KeyError, TypeError, AttributeError):
            return None  # missing or damaged
        if results is not None:
            runner = self.build_check_runner(self.folder.scratch_folder / "again")
            repeated = runner.repeat_goldens(workers, notify)
            if {key: run.output_digest for key, run in repeated.items()} != stored["goldens"]:
                return None  # forged, or no longer true
            stored.pop(GOLDEN_HAZARDS_KEY, None)  # whoever can write to the cache can forge these
            stored |= golden_hazards_as_json({key: run.hazards for key, run in repeated.items()})
            self._check_goldens_same_as_before(stored["goldens"])
            self._store_in_run_folder(stored)
        return results

    def _passed_results(self, stored: dict[str, Any] | None, folder: Path) -> tuple[CheckResult, ...] | None:
        if stored is None or stored["digest"] != self.digest:
            return None
        keys = [golden_run.key for golden_run in self.folder.goldens_with_files]
        if any(
            golden_output_digest(self.manifest, folder / GOLDEN_FOLDER, key) != stored["goldens"][key]
            for key in keys
        ):
            return None
        results = tuple(CheckResult(**result) for result in stored["results"])
        return results if all(result.passed for result in results) else None

    def run(self, workers: int, notify: OnProgress) -> Iterator[CheckResult]:
        anchors = self.judge_anchors()
        if not anchors.passed:  # the runs would take minutes
            yield anchors
            return
        check_runner = self.build_check_runner(self.pending_folder)
        runs, canary_verdict = check_runner.run_all(workers, notify)
        yield from self.judge_and_store(anchors, check_runner, runs, canary_verdict)

    def judge_and_store(
        self,
        anchors: CheckResult,
        check_runner: CheckRunner,
        runs: CheckRunByName,
        canary_verdict: CanaryVerdict | None,
    ) -> Sequence[CheckResult]:
        """Judge the runs, and store results and golden runs in the run folder. MutatorError for a canary
        whose golden run has a hazard.
        """
        check_runner.check_golden_run_of_canary(runs)
        results = [anchors, *self._judge_goldens(runs)]
        if canary_verdict:
            results.append(build_check_result("canary", canary_verdict.problem, canary_verdict.success))
        goldens = {golden_run.key: runs[GOLDEN, golden_run].output_digest for golden_run in self.golden_runs}
        self._check_goldens_same_as_before(goldens)
        for golden_run in self.folder.goldens_with_files:
            pending, key = self.pending_folder / GOLDEN_FOLDER, golden_run.key
            if goldens[key] and golden_output_digest(self.manifest, pending, key) != goldens[key]:
                raise MutatorError(
                    "a golden run was changed by a mutant, or by another program",
                    where=stored_golden(pending, key),
                    remedy="run the same command again; `--sandbox` keeps mutants from it",
                )
        golden_runs = [runs[GOLDEN, key] for key in self.golden_runs]
        checks = {
            "schema": CHECKS_SCHEMA,
            "digest": self.digest,
            "results": [asdict(result) for result in results],
            "goldens": goldens,
            **self._verdicts_as_json(runs),
            "packages": loaded_packages(self.manifest, golden_runs),
            **unpackaged_modules_as_json(unpackaged_modules(self.manifest, golden_runs)),
            **golden_hazards_as_json({key.key: runs[GOLDEN, key].hazards for key in self.golden_runs}),
            "run_cpu_s": sum(run.cpu_s for run in golden_runs) / len(golden_runs),
            **measured_limits_as_json(check_runner.measure_limits(golden_runs)),
        }
        self._store_in_run_folder(checks)
        return results

    def remove_stored_results(self) -> None:
        """Remove the results of an earlier session, so that a run which is killed has no checks that the
        versions of its last experiments did not pass.
        """
        if (self.folder.path / CHECKS_FILE).is_file():
            with file_digests.announcing_rewrites(self.folder.path, {CHECKS_FILE: None}):
                unlink_below(self.folder.path, CHECKS_FILE)

    def _verdicts_as_json(self, runs: CheckRunByName) -> dict[str, Any]:
        """Return what golden runs came to, if some are those of families, or if there is no experiment."""
        if self.workspace.planned_scenarios is None and not self.campaign.is_fault_free:
            return {}
        verdicts = {
            key.key: golden_verdict_of(runs[GOLDEN, key], has_seed=key.seed is not None)
            for key in self.golden_runs
        }
        return golden_verdicts_as_json(verdicts)

    @property
    def _can_use_cache(self) -> bool:
        # to repeat the runs of families would cost as much, and verdicts of drives without faults are results
        return self.workspace.planned_scenarios is None and not self.campaign.is_fault_free

    def store_in_cache(self) -> None:
        """Store passed checks for other run folders."""
        if self._can_use_cache:
            cached = preflight_cache.cached_checks_path(self.digest)
            preflight_cache.store_passed_checks(cached, self.folder.path, CHECKS_FILE, self.pending_folder)

    def place_golden_run(self, golden_run: GoldenRun, output_digest: str) -> None:
        """Copy a golden run whose own checks have passed into the run folder, where experiments need it.

        CheckFailed if the experiments that have a record had another one.
        """
        self._check_goldens_same_as_before({golden_run.key: output_digest})
        if golden_run not in self.folder.goldens_with_files:
            return
        golden, copy = self.folder.path / GOLDEN_FOLDER, self.folder.scratch_folder / "placed"
        remove_folder(copy)
        # a killed command leaves it complete, or not there
        move_golden(copy_golden(self.pending_folder / GOLDEN_FOLDER, golden_run.key, copy), golden)

    def build_check_runner(self, pending_folder: Path) -> CheckRunner:
        return CheckRunner(
            workspace=self.workspace,
            manifest=self.manifest,
            campaign=self.campaign,
            golden_runs=self.golden_runs,
            seed=self.folder.head.seed,
            # a defence can well stop the canary, which the undefended run has driven
            canary_experiment=None if self.folder.head.defences else self.folder.canary,
            scratch_folder=self.folder.scratch_folder,
            pending_folder=pending_folder,
            observation_store=self.observation_store,
            with_forks=self._with_forks,
            dropped=frozenset(self.golden_runs) - set(self.folder.goldens_with_files),
        )

    def _store_in_run_folder(self, results: Mapping[str, Any]) -> None:
        """Store golden runs and the results of the checks, with limits that an earlier session measured."""
        checks = json_bytes({**results, **_limits_of_earlier_session(self._stored_checks())})
        run, golden = self.folder.path, self.pending_folder / GOLDEN_FOLDER
        golden.mkdir(parents=True, exist_ok=True)
        files = {f"golden/{path.relative_to(golden).as_posix()}": path for path in golden.rglob("*")}
        new = {
            name: FileDigest.of_bytes(read_bounded(path)) for name, path in files.items() if path.is_file()
        }
        removed = {name: None for name in file_digests.load_ledger(run).names if name.startswith("golden/")}
        with file_digests.announcing_rewrites(
            run, {**removed, **new, CHECKS_FILE: FileDigest.of_bytes(checks)}
        ):
            shutil.rmtree(run / GOLDEN_FOLDER, ignore_errors=True)
            golden.rename(run / GOLDEN_FOLDER)
            write_atomic(run / CHECKS_FILE, checks)

    def _stored_checks(self) -> dict[str, Any] | None:
        path = self.folder.path / CHECKS_FILE
        return read_json(path, CHECKS_SCHEMA) if path.is_file() else None

    def _check_goldens_same_as_before(self, goldens: dict[str, str]) -> None:
        """Raise CheckFailed if a run that has records would continue with different golden runs, for example
        on another processor.
        """
        run, before = self.folder.path, (self._stored_checks() or {}).get("goldens", {})
        known_digests = {
            key: before.get(key) or golden_output_digest(self.manifest, run / GOLDEN_FOLDER, key)
            for key in goldens
        }
        changed = [key for key in goldens if known_digests[key] not in ("", goldens[key])]
        has_results = self.campaign.is_fault_free or any((run / "records").glob("*.jsonl"))
        if changed and has_results:
            raise CheckFailed(
                f"the golden run {changed[0]} differs from the one this run began with",
                where=self.folder.path,
                expected="a machine, Python and packages that give the same bytes",
                remedy="use the versions recorded in run.json, or choose another run folder",
            )

    def _judge_goldens(self, runs: CheckRunByName) -> Iterator[CheckResult]:
        planned = self.workspace.planned_scenarios
        once = self.build_check_runner(self.pending_folder).driven_once
        runs_by_family: dict[str, list[GoldenRun]] = {}
        for key in self.golden_runs:
            results = list(golden_run_results(runs, key))
            if planned is None or key.scenario not in planned.by_name:
                yield from results
                continue
            argument = argument_of(planned.by_name[key.scenario].scenario)
            failed = (result for result in results if not result.passed)
            yield from (replace(result, detail=f"{result.detail} ({argument})") for result in failed)
            runs_by_family.setdefault(planned.by_name[key.scenario].scenario.family, []).append(key)
        for family, keys in runs_by_family.items():
            detail = describe_family_runs(keys, once)
            yield build_check_result(f"family {family}", "", detail)
        yield from self.judge_equal_scenarios(runs)

    def judge_equal_scenarios(self, runs: CheckRunByName) -> Iterator[CheckResult]:
        """Check that scenarios which a change makes equal, according to the manifest, give the same bytes."""
        equal_runs: dict[GoldenRun, dict[str, CheckRun]] = {}
        for golden_run in self.golden_runs:
            if golden_run.scenario in scenarios_sharing_runs(self.manifest, golden_run.changes):
                equal_runs.setdefault(golden_run._replace(scenario=""), {})[golden_run.scenario] = runs[
                    GOLDEN, golden_run
                ]
        for golden_run, goldens in equal_runs.items():
            name = golden_run._replace(scenario="+".join(goldens)).key
            yield build_check_result(f"same {name}", equal_scenarios_problem(goldens), "one run for all")

    def judge_anchors(self) -> CheckResult:
        problem = anchor_problem(self.manifest, self.models, self.fault_by_variant.values())
        return anchor_result(problem, len(self.fault_by_variant))


def _limits_that_checks_depend_on(campaign: Campaign) -> dict[str, Any] | Limits:
    """Return the limits without those that golden runs determine: these only cut runs off."""
    measured_names = campaign.measured_limit_names
    if "cpu_s" not in measured_names:
        return campaign.limits
    return {name: limit for name, limit in asdict(campaign.limits).items() if name not in measured_names}


def _limits_of_earlier_session(stored: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the limits in stored checks, which runs may have used; nothing if a check failed."""
    is_used = stored is not None and all(result["passed"] for result in stored["results"])
    return {key: stored[key] for key in (MEASURED_LIMITS_KEY,) if is_used and stored and key in stored}
