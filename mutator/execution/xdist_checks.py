"""The checks of a session in the loop of xdist's controller, which deals them like experiments."""

from collections.abc import Hashable, Iterable
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.execution.session import Session
from mutator.execution.xdist_worker import GOLDENS_COMMAND
from mutator.preflight.checks_beside_experiments import ChecksBesideExperiments

_ENDED_EVENT = "mutator_checks"


class XdistChecks:
    """Deals the checks of a session that experiments do not wait for, if it has any."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._loop: Any = None
        self._nodes: list[Any] = []  # workers that have what they need to begin
        self.scheduler: Any = None

    def begin(self, config: pytest.Config, worker_count: int) -> None:
        """Begin checks on all cores, while workers start. Their ends come to xdist's loop as events."""
        self._loop = config.pluginmanager.getplugin("dsession")
        if checks := self._session.checks.beside:
            setattr(self._loop, f"worker_{_ENDED_EVENT}", self._note_ends)
            checks.on_end = lambda: self._loop.queue.put((_ENDED_EVENT, {}))
            _start(checks, worker_count)

    def remaining(self) -> ChecksBesideExperiments | None:
        """Return the checks if any have not ended."""
        checks = self._session.checks.beside
        return checks if checks and checks.has_remaining else None

    def is_checked(self, golden_key: Hashable) -> bool:
        """Whether experiments with this golden run can run."""
        return self._session.checks.can_use(str(golden_key))

    def note_worker_began(self, node: Any) -> None:
        """Tell a worker which golden runs have passed; it gets the others as they pass."""
        self._nodes.append(node)
        if self._session.checks.beside:
            facts = self._session.checks.golden_facts(self._session.manifest)
            node.sendcommand(GOLDENS_COMMAND, facts=facts.to_bytes())

    def _note_ends(self) -> None:
        """Let workers run what the checks have passed that ended, and stop everything if one has failed."""
        checks = self._session.checks.beside
        if checks is None:
            return
        try:
            self._announce(self._session.checks.take_passed())
        except MutatorError as err:
            if not checks.has_failed:
                self._session.problem = self._session.problem or str(err)
            self._loop.shouldstop = str(err)
            return
        if checks.has_failed:
            self._loop.shouldstop = "a check has failed"
        elif not self._nodes:  # workers still start
            _start(checks, checks.workers)
        else:
            for node in [*self.scheduler.nodes]:
                self.scheduler.check_schedule(node)

    def _announce(self, golden_keys: Iterable[str]) -> None:
        if not (keys := tuple(golden_keys)):
            return
        facts = self._session.checks.golden_facts(self._session.manifest, keys)
        self._session.note_packages(facts.packages)
        for node in self._nodes:
            if not node.shutting_down:
                node.sendcommand(GOLDENS_COMMAND, facts=facts.to_bytes())


def _start(checks: ChecksBesideExperiments, count: int) -> None:
    while checks.has_waiting and checks.running < count:
        checks.start_next()
