"""What a batch must meet before it is planned: experiments that fit the bench, and unchanged files."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from mutator._common.confined_files import checked_name_not_path
from mutator._common.message_text import describe_choices
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.source_watch import SourceWatch
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


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

    def check(self, experiments: Iterable[Experiment]) -> dict[str, Experiment]:
        """Return the experiments by id; MutatorError for one that does not fit, and for a file that was
        edited while the bench was open.
        """
        if isinstance(experiments, Experiment | str):
            raise MutatorError(repr(experiments), argument="experiments", expected="a list of experiments")
        batch: dict[str, Experiment] = {}
        for experiment in experiments:
            if not isinstance(experiment, Experiment):
                raise MutatorError(
                    repr(experiment),
                    argument="experiments",
                    expected="experiments, as `build_experiment` makes them",
                )
            self._check_fits(experiment)
            batch[experiment.id] = experiment
        self._watch.check_unchanged()
        return batch

    def note_scenario(self, scenario: str) -> Path:
        """Watch the file of a scenario from now on, and return it."""
        if scenario not in self._scenario_files:
            path = self._workspace.scenario(scenario)
            self._watch.add([path])
            self._scenario_files[scenario] = path
        return self._scenario_files[scenario]

    def _check_fits(self, experiment: Experiment) -> None:
        checked_name_not_path(experiment.scenario, "experiments")
        file = self.note_scenario(experiment.scenario)
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
        for change in experiment.changes:
            if change not in self._manifest.args_by_change:
                raise MutatorError(
                    f"{experiment.label}: change '{change}'",
                    argument="experiments",
                    expected=describe_choices(self._manifest.args_by_change),
                    remedy="name a change of the target's manifest",
                )
