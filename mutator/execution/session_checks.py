"""The checks of a session: all before its experiments, or each golden run's before those that need it."""

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from mutator._common.files import raising_disk_full
from mutator.errors import CheckFailed, DiskFull, MutatorWarning
from mutator.execution.golden_facts import GoldenFacts
from mutator.preflight.check_judgements import loaded_packages, unpackaged_modules
from mutator.preflight.check_run_problems import CheckRun
from mutator.preflight.checks_beside_experiments import ChecksBesideExperiments, begin_checks
from mutator.preflight.failed_golden_run_pages import with_golden_run_pages
from mutator.preflight.preflight_checks import describe_unreached_triggers, run_checks
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


class SessionChecks:
    """Runs the checks of a run folder, and says what is known of them.

    `beside` are those that experiments do not wait for; None if all have passed. `were_abandoned` tells
    whether the session ended before they had: what its experiments gave is then provisional.
    """

    def __init__(
        self,
        workspace: Workspace,
        *,
        workers: int,
        secret: bytes,
        with_forks: bool,
        notify: ProgressCallback,
    ) -> None:
        self._workspace, self._workers, self._secret, self._notify = workspace, workers, secret, notify
        self._with_forks = with_forks
        self.beside: ChecksBesideExperiments | None = None
        self._passed: dict[str, CheckRun] = {}
        self.were_abandoned = False

    def begin(self, folder: RunFolder, *, beside_experiments: bool) -> None:
        """Run all checks or, with `beside_experiments`, those that experiments must wait for. CheckFailed if
        one fails.
        """
        with self._naming_golden_run_pages(folder):
            if beside_experiments and self._workers:
                self.beside = begin_checks(
                    self._workspace,
                    folder,
                    workers=self._workers,
                    notify=self._notify,
                    secret=self._secret,
                    with_forks=self._with_forks,
                )
            else:
                run_checks(
                    self._workspace,
                    folder,
                    workers=self._workers,
                    notify=self._notify,
                    secret=self._secret,
                    with_forks=self._with_forks,
                )
        if not self.beside:
            self._warn_of_unreached_triggers(folder)

    def take_passed(self) -> tuple[str, ...]:
        """Take note of checks that have ended; return the keys of golden runs that have passed."""
        assert self.beside is not None
        new = self.beside.collect()
        self._passed |= new
        return tuple(new)

    def can_use(self, golden_key: str) -> bool:
        """Whether experiments can use a golden run."""
        return self.beside is None or golden_key in self._passed

    def golden_facts(self, manifest: TargetManifest, keys: Iterable[str] | None = None) -> GoldenFacts:
        """Return what workers need to know of these golden runs, or of all that have passed."""
        runs = {key: self._passed[key] for key in (self._passed if keys is None else keys)}
        return GoldenFacts(
            digest_by_key={key: run.output_digest for key, run in runs.items()},
            packages=tuple(loaded_packages(manifest, runs.values())),
            modules_without_package=unpackaged_modules(manifest, runs.values()),
        )

    def finish(self, folder: RunFolder, *, was_cut_off: bool) -> bool:
        """Do what remains, and store it; return whether anything did. CheckFailed if a check has failed, and
        DiskFull.

        Nothing more runs if the session was cut off, unless a failed check was the reason.
        """
        checks, self.beside = self.beside, None
        if checks is None:
            return False
        if was_cut_off and not checks.has_failed and checks.has_remaining:
            checks.close()
            self.were_abandoned = True
            return False
        try:
            with self._naming_golden_run_pages(folder), raising_disk_full(folder.path):
                checks.finish(self._notify)
        except DiskFull:
            self.were_abandoned = True
            raise
        self._warn_of_unreached_triggers(folder)
        return True

    def describe_progress(self) -> str:
        """Say that verdicts are provisional, and how far the checks are; empty once all have passed."""
        checks = self.beside
        if checks is None or not checks.has_remaining:
            return ""
        return f"provisional: {checks.ended_count} of {checks.total} checks done"

    def _warn_of_unreached_triggers(self, folder: RunFolder) -> None:
        for remark in describe_unreached_triggers(self._workspace, folder):
            warnings.warn(remark, MutatorWarning, stacklevel=4)

    @contextmanager
    def _naming_golden_run_pages(self, folder: RunFolder) -> Iterator[None]:
        try:
            yield
        except CheckFailed as error:
            raise with_golden_run_pages(error, folder.path, self._workspace) from None
