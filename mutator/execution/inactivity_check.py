"""Finds out why faults were never active, by running their statements without the faults."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import remove_folder
from mutator._common.hashing import content_id
from mutator.engines.engine_jobs import EngineArguments, Job
from mutator.engines.reach_jobs import watched_job
from mutator.engines.reference_engine import ReferenceEngine, make_reference_engine
from mutator.errors import MutatorError
from mutator.faults.message_places import changes_messages, describe_message
from mutator.model import Experiment, FaultLocation, Status
from mutator.mutants.execution_counting_mutant import build_counting_mutant
from mutator.mutants.injection_edits import is_in_tree
from mutator.mutants.probe_contract import was_triggered
from mutator.outcomes.inactivity_reasons import UNTRIGGERED_REASON, Reach, reach_of_place

_UNKNOWN = ((Reach.NEVER, "its code did not run while the trigger held"),)


class InactivityCheck:
    """Finds the reasons on the reference engine, so they are the same for every engine.

    Where statements execute depends only on the golden run, because a fault that was never active changed
    nothing. So one run serves all faults at the same places of a golden run.
    """

    def __init__(self, arguments: EngineArguments) -> None:
        self._arguments = arguments
        self._engine: ReferenceEngine | None = None
        self._reasons: dict[object, tuple[tuple[Reach, str], ...]] = {}

    def reason(self, experiment: Experiment, scenario: Path, probe_report: Mapping[str, Any]) -> str:
        """Return why the experiment's fault was never active."""
        if not was_triggered(probe_report):
            return UNTRIGGERED_REASON
        unset = probe_report.get("unset")
        if isinstance(unset, dict) and unset:
            return "; ".join(dict.fromkeys(map(str, unset.values())))
        locations = self._locations(experiment)
        if not locations:
            return "the defence that it changes is not in the tree"
        key = (
            experiment.scenario,
            experiment.scenario_digest,
            experiment.changes,
            experiment.seed,
            locations,
        )
        if key not in self._reasons:
            self._reasons[key] = self._find_reach(experiment, scenario, locations)
        return self._text(experiment, self._reasons[key])

    def _text(self, experiment: Experiment, places: tuple[tuple[Reach, str], ...]) -> str:
        limited = any(i.where or i.call or i.every for i in experiment.fault.injections)
        selected = " and `where`, `call` or `every` selects it" if limited else ""
        texts = []
        for location, (reach, text) in zip(self._locations(experiment), places, strict=False):
            awaited = self._awaited_messages(experiment, location)
            texts.append(f"{text}{selected}{awaited}" if reach is Reach.IN_RUN else text)
        return "; ".join(dict.fromkeys(texts))

    def _awaited_messages(self, experiment: Experiment, location: FaultLocation) -> str:
        """Return ` and a message of topic 'gap' comes`, for faults of messages at the location; else ''."""
        messages = [
            describe_message(injection, self._arguments.manifest)
            for injection in experiment.fault.injections
            if injection.location == location
            and changes_messages(self._arguments.models.get(injection.model))
        ]
        return f" and {' or '.join(dict.fromkeys(messages))} comes" if messages else ""

    def _find_reach(
        self, experiment: Experiment, scenario: Path, locations: tuple[FaultLocation, ...]
    ) -> tuple[tuple[Reach, str], ...]:
        arguments = self._arguments
        try:
            mutant, location_by_id = build_counting_mutant(arguments.manifest, arguments.models, locations)
        except MutatorError:
            return _UNKNOWN  # a foreign fault model can allow places that cannot be counted
        job = watched_job(
            Job(
                name=f"reach-{content_id([experiment.id])}",
                scenario=scenario,
                seed=experiment.seed,
                scenario_changes=experiment.changes,
                changed_files=mutant.files,
                mutant_id=mutant.id,
                injection_ids=mutant.injection_ids,
            ),
            location_by_id,
        )
        if self._engine is None:
            self._engine = make_reference_engine(arguments)
        folder = path_below(arguments.work_folder, self._engine.folder_of_job(job).name)
        try:
            result = self._engine.execute(job, folder)
        finally:
            remove_folder(folder)
        if result.status is not Status.OK:
            return _UNKNOWN
        reached = [
            reach_of_place(arguments.manifest, job, result, name, location)
            for name, location in location_by_id.items()
        ]
        return tuple((place.reach, place.text) for place in reached)

    def close(self) -> None:
        if self._engine is not None:
            self._engine.close()

    def _locations(self, experiment: Experiment) -> tuple[FaultLocation, ...]:
        tree, injections = self._arguments.manifest.tree, experiment.fault.injections
        return tuple(dict.fromkeys(each.location for each in injections if is_in_tree(each, tree)))
