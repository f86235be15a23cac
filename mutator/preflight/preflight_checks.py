"""The checks that must pass before a campaign starts: equal golden runs, null mutants, canary, anchors."""

import shutil
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mutator._common import cached_folders
from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import inside
from mutator._common.files import json_bytes, raising_disk_full, read_json, write_atomic
from mutator._common.hashing import digest
from mutator.campaigns import run_environment
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.shared_runs import same_in
from mutator.errors import CheckFailed, DiskFull, InvalidMutant, MutatorError
from mutator.mutants.mutant_building import build
from mutator.preflight import preflight_cache, unreached_triggers
from mutator.preflight.preflight_rules import (
    CheckRun,
    digest_of,
    judge_golden,
    judge_null,
    judge_same,
)
from mutator.preflight.preflight_runs import AGAIN, GOLDEN, NULL, CheckDriver, Notify, Runs
from mutator.store import file_digests, plan_file
from mutator.store.check_results import FILE, SCHEMA, CheckResult
from mutator.store.file_digests import FileDigest
from mutator.store.run_folder import GoldenRun, RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always
from mutator.workspace import Workspace


def run_checks(
    workspace: Workspace, folder: RunFolder, *, workers: int = 1, notify: Notify | None = None
) -> tuple[CheckResult, ...]:
    """Run the checks, and store the results in checks.json and the golden runs in the folder.

    Nothing runs if the checks have passed for these sources in this folder. If they have passed in another
    folder on this machine, only the golden runs are repeated, because a mutant can write to the cache.
    Raises CheckFailed if any check fails, after all have run.
    """
    checks = _Checks(workspace, folder)
    notify = notify or (lambda progress: None)
    known = checks.known(workers, notify)
    if known is not None:
        return known
    with raising_disk_full(folder.path):
        results = tuple(checks.run(workers, notify))
    failed = [result for result in results if not result.passed]
    if failed:
        text = "; ".join(f"{result.name}: {result.detail}" for result in failed[:3])
        raise CheckFailed(
            f"{len(failed)} of {len(results)} checks before the campaign failed: {text}",
            where=folder.path / FILE,
            remedy="fix target, templates or canary (`mutator check --drive` shows details); the campaign "
            "starts only if all pass",
        )
    preflight_cache.store(preflight_cache.entry(checks.digest), folder.path, FILE, checks.kept)
    return results


def describe_unreached_triggers(workspace: Workspace, folder: RunFolder) -> list[str]:
    """Remarks on triggers of the plan that no golden run reaches; none unless the golden runs just ran or
    were cached.
    """
    experiments = ((folder.golden_run_of(e).key, e) for e in plan_file.iterate_experiments(folder.path))
    observed = unreached_triggers.read_observed(_kept(folder))
    manifest = workspace.manifest(folder.head.target)
    return unreached_triggers.remarks(workspace, manifest, experiments, observed) if observed else []


def are_there(folder: RunFolder) -> bool:
    places = (folder.golden_folder(*one) for one in folder.golden_runs)
    goldens = (inside(place, name) for place in places for name in folder.head.golden_files)
    return all(path.is_file() for path in (folder.path / FILE, *goldens))


def _kept(folder: RunFolder) -> Path:
    """Return the folder that keeps golden runs until they are accepted. Their observations stay there."""
    return folder.scratch_folder / "kept"


class _Checks:
    def __init__(self, workspace: Workspace, folder: RunFolder) -> None:
        head = folder.head
        self.workspace = workspace
        self.folder = folder
        self.kept = _kept(folder)
        self.manifest: TargetManifest = workspace.manifest(head.target)
        self.models = workspace.fault_models()
        self.keys = folder.golden_runs
        now = RunInputs.of(workspace, self.manifest, folder.scenarios).digests()
        self.variants = {fault.spec: fault for fault in plan_file.load_faults(folder.path).values()}
        places = sorted((name, [i.location for i in f.injections]) for name, f in self.variants.items())
        content = [
            now,
            run_environment.surroundings(),
            head.goldens,
            head.seed,
            folder.canary.id,
            head.canary_hazard,
            head.limits,
        ]
        self.digest = digest([*content, places])

    def known(self, workers: int, notify: Notify) -> tuple[CheckResult, ...] | None:
        """Earlier results, copied from another folder if necessary; None unless all checks passed and the
        golden runs are unchanged.
        """
        if (results := self._passed(self._before(), self.folder.path)) is not None:
            return results
        copy = self.kept
        try:
            with raising_disk_full(copy):
                cached_folders.fetch(preflight_cache.entry(self.digest), copy)
            found = read_json(copy / FILE, SCHEMA)
            results = self._passed(found, copy)
        except DiskFull:
            raise
        except (MutatorError, OSError, KeyError, TypeError, AttributeError):
            return None  # missing or damaged
        if results is not None:
            if (
                self._driver(self.folder.scratch_folder / "again").drive_goldens(workers, notify)
                != found["goldens"]
            ):
                return None  # forged, or no longer true
            self._check_same_as_before(found["goldens"])
            self._install(read_bounded(copy / FILE))
        return results

    def _passed(self, said: dict[str, Any] | None, place: Path) -> tuple[CheckResult, ...] | None:
        if said is None or said["digest"] != self.digest:
            return None
        keys = [one.key for one in self.keys]
        if any(
            digest_of(self.manifest, inside(place / "golden", key)) != said["goldens"][key] for key in keys
        ):
            return None
        results = tuple(CheckResult(**result) for result in said["results"])
        return results if all(result.passed for result in results) else None

    def run(self, workers: int, notify: Notify) -> Iterator[CheckResult]:
        anchors = self._anchors()
        if not anchors.passed:  # the runs would take minutes
            yield anchors
            return
        runs, canary_verdict = self._driver(self.kept).drive(workers, notify)
        results = [anchors, *self._judge(runs), _result("canary", *canary_verdict)]
        goldens = {one.key: runs[GOLDEN, one].digest for one in self.keys}
        self._check_same_as_before(goldens)
        cpu = [runs[GOLDEN, key].cpu_s for key in self.keys]
        checks = {
            "schema": SCHEMA,
            "digest": self.digest,
            "results": [asdict(result) for result in results],
            "goldens": goldens,
            "packages": self._packages(runs),
            "run_cpu_s": sum(cpu) / len(cpu),
        }
        self._install(json_bytes(checks))
        yield from results

    def _driver(self, kept: Path) -> CheckDriver:
        return CheckDriver(workspace=self.workspace, folder=self.folder, manifest=self.manifest, kept=kept)

    def _install(self, checks: bytes) -> None:
        run, golden = self.folder.path, self.kept / "golden"
        golden.mkdir(parents=True, exist_ok=True)
        files = {f"golden/{path.relative_to(golden).as_posix()}": path for path in golden.rglob("*")}
        new = {
            name: FileDigest.of_bytes(read_bounded(path)) for name, path in files.items() if path.is_file()
        }
        gone = {name: None for name in file_digests.load_ledger(run).names if name.startswith("golden/")}
        with file_digests.rewriting_files(run, {**gone, **new, FILE: FileDigest.of_bytes(checks)}):
            shutil.rmtree(run / "golden", ignore_errors=True)
            golden.rename(run / "golden")
            write_atomic(run / FILE, checks)

    def _before(self) -> dict[str, Any] | None:
        path = self.folder.path / FILE
        return read_json(path, SCHEMA) if path.is_file() else None

    def _check_same_as_before(self, goldens: dict[str, str]) -> None:
        """Raise CheckFailed if a run that has records would continue with different golden runs, for example
        on another processor.
        """
        run, before = self.folder.path, (self._before() or {}).get("goldens", {})
        known = {
            key: before.get(key) or digest_of(self.manifest, inside(run / "golden", key)) for key in goldens
        }
        other = [key for key in goldens if known[key] not in ("", goldens[key])]
        if other and any((run / "records").glob("*.jsonl")):
            raise CheckFailed(
                f"the golden run {other[0]} differs from the one this run began with",
                where=self.folder.path,
                expected="a machine, Python and packages that give the same bytes",
                remedy="use the versions recorded in run.json, or choose another run folder",
            )

    def _packages(self, runs: Runs) -> list[str]:
        """Return the packages that the golden runs loaded, without the target and the standard library."""
        loaded = {module for key in self.keys for module in runs[GOLDEN, key].modules}
        own = {path.split("/")[0].removesuffix(".py") for path in self.manifest.tree.files}
        return list(run_environment.packages_of(loaded - own))

    def _judge(self, runs: Runs) -> Iterator[CheckResult]:
        for key in self.keys:
            first, again, null = (runs[name, key] for name in (GOLDEN, AGAIN, NULL))
            detail = judge_golden(first, again)
            yield _result(f"golden {key.key}", detail, "the same bytes twice")
            if not first.problem:
                detail = judge_null(first, null)
                yield _result(f"null mutant {key.key}", detail, "the same bytes as golden")
        yield from self._judge_same(runs)

    def _judge_same(self, runs: Runs) -> Iterator[CheckResult]:
        """Check that scenarios which a change makes equal, according to the manifest, give the same bytes."""
        same: dict[GoldenRun, dict[str, CheckRun]] = {}
        for one in self.keys:
            if one.scenario in same_in(self.manifest, one.changes):
                same.setdefault(one._replace(scenario=""), {})[one.scenario] = runs[GOLDEN, one]
        for one, goldens in same.items():
            name = one._replace(scenario="+".join(goldens)).key
            yield _result(f"same {name}", judge_same(goldens), "one run for all")

    def _anchors(self) -> CheckResult:
        """Check that each variant of the plan finds its statements. A mutant that does not compile
        passes this check.
        """
        problems: dict[str, list[str]] = {}
        for fault in self.variants.values():
            try:
                build(self.manifest, self.models, fault, always())
            except InvalidMutant:
                continue
            except MutatorError as err:
                problems.setdefault(str(err), []).append(fault.spec)
        text = "; ".join(f"{', '.join(specs)}: {problem}" for problem, specs in problems.items())
        return _result("anchors", text, f"{len(self.variants)} variants found their statements")


def _result(name: str, problem: str, found: str) -> CheckResult:
    return CheckResult(name=name, passed=not problem, detail=problem or found)
