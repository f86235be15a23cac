"""What a batch must meet before it is planned: experiments that fit the bench, and unchanged files."""

from collections.abc import Iterable, Mapping
from dataclasses import fields
from pathlib import Path

from mutator._common.argument_checks import check_type
from mutator._common.confined_files import checked_name_not_path
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.source_watch import SourceWatch
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.store import plan_file
from mutator.store.plan_lines import parse_experiment, parse_fault
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


def check_reason(reason: object) -> None:
    """Raise MutatorError unless `reason` is text that a file can have."""
    check_type("reason", reason, str, "text")
    try:
        str(reason).encode()
    except UnicodeEncodeError:
        raise MutatorError(ascii(reason), argument="reason", expected="text of whole characters") from None


class BatchCheck:
    """Checks batches, and finds the files of their scenarios."""

    def __init__(self, workspace: Workspace, manifest: TargetManifest, campaign: Campaign) -> None:
        self._workspace, self._manifest, self._campaign = workspace, manifest, campaign
        self._watch = SourceWatch(workspace, manifest)
        self._scenario_files: dict[str, Path] = {}

    @property
    def scenario_files(self) -> Mapping[str, Path]:
        """The file of each scenario that a batch or the plan has."""
        return self._scenario_files

    def check(self, experiments: Iterable[Experiment]) -> list[Experiment]:
        """Return the experiments; MutatorError for one that does not fit, and for a file that was edited
        while the bench was open.
        """
        if isinstance(experiments, Experiment | str) or not isinstance(experiments, Iterable):
            raise MutatorError(repr(experiments), argument="experiments", expected="a list of experiments")
        batch = list(experiments)
        for experiment in batch:
            if not isinstance(experiment, Experiment):
                raise MutatorError(
                    repr(experiment),
                    argument="experiments",
                    expected="experiments, as `build_experiment` makes them",
                )
            _check_can_be_stored(experiment)
            self._check_fits(experiment)
        self._watch.check_unchanged()
        return batch

    def note_scenario(self, scenario: str, family: str | None = None) -> Path:
        """Watch the file of a scenario, and of its family, from now on; return that of the scenario."""
        if scenario not in self._scenario_files:
            path = self._workspace.scenario(scenario)
            self._watch.add([path, *([self._workspace.family(family).path] if family else [])])
            self._scenario_files[scenario] = path
        return self._scenario_files[scenario]

    def _check_fits(self, experiment: Experiment) -> None:
        checked_name_not_path(experiment.scenario, "experiments")
        concrete = experiment.concrete
        if concrete is not None and self._workspace.planned_scenarios is not None:
            self._workspace.planned_scenarios.add(concrete)
        file = self.note_scenario(experiment.scenario, concrete.family if concrete else None)
        values = {
            "scenario_digest": (experiment.scenario_digest, self._watch.digest_of(file)),
            "after_hazard": (str(experiment.after_hazard), str(self._campaign.after_hazard)),
            "reading": (experiment.fault.reading, self._campaign.reading or ""),
        }
        for name, (value, expected) in values.items():
            if value != expected:
                raise MutatorError(
                    f"{experiment.label}: {name} '{value}'",
                    argument="experiments",
                    expected=f"'{expected}', as in this bench",
                    remedy="build the experiment anew, or open another bench",
                )
        if not 0 <= experiment.seed < 2**63:
            raise MutatorError(
                f"{experiment.label}: seed {experiment.seed}",
                argument="experiments",
                expected="seeds from 0 to 2**63 - 1",
            )
        for change in experiment.changes:
            if change not in self._manifest.args_by_change:
                raise MutatorError(
                    f"{experiment.label}: change '{change}'",
                    argument="experiments",
                    expected=describe_choices(self._manifest.args_by_change),
                    remedy="name a change of the target's manifest",
                )


def _check_can_be_stored(experiment: Experiment) -> None:
    """Raise MutatorError unless the plan's files give the experiment back as it is."""
    try:
        fault = parse_fault(plan_file.fault_line(experiment.fault))
        stored = parse_experiment(plan_file.experiment_line(experiment), {fault.id: fault})
        misfits = [
            f"{field.name} {value!r}"
            for field in fields(Experiment)
            if field.compare
            and type(value := getattr(experiment, field.name)) is not type(getattr(stored, field.name))
        ]
    except (MutatorError, AttributeError, LookupError, TypeError, ValueError) as err:
        misfits = [f"{type(err).__name__}: {err}"]
    if misfits:
        raise MutatorError(
            f"an experiment that the plan cannot store ({misfits[0]})",
            argument="experiments",
            expected="experiments, as `build_experiment` makes them",
        )
