"""The smallest form of a fault with the same hazard."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.phrase_texts import planned_number_text
from mutator.api.experiment_results import experiment_facts
from mutator.api.stored_experiments import open_stored_run
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.single_experiment_campaign import (
    check_campaign_name,
    save_single_experiment_campaign,
)
from mutator.errors import MutatorError
from mutator.explore.fault_forms import Axis
from mutator.model import Experiment, Outcome, Record
from mutator.workspace import Workspace

_ORDINARY_ENDINGS = (Outcome.NOT_ACTIVATED, Outcome.MASKED, Outcome.SDC)


@dataclass(frozen=True, kw_only=True)
class SmallestForm:
    """The smallest form that was found of a fault with its hazard. All of it has run."""

    original: Experiment  #: the experiment as it was
    experiment: Experiment  #: its smallest form
    record: Record  #: the record of the smallest form
    hazard: str  #: the hazard, the first one of the original
    start_s: float  #: when the fault begins, in s
    duration_s: float | None  #: how long it lasts, in s; None: as long as its trigger or spec specifies
    hazard_s: float  #: when the hazard comes, in s
    original_start_s: float  #: when the original's fault begins, in s
    original_hazard_s: float  #: when the original's hazard comes, in s
    #: the next shorter fault and the next smaller one, which come out without the hazard, by `duration` and
    #: `size`; an axis is missing if there is none
    neighbours: dict[Axis, Experiment]
    steps: tuple[tuple[str, Experiment], ...]  #: what became simpler, and the experiment then
    observed_s: float | None  #: how long the drive goes on after the fault, in s; None without a duration
    endings: dict[Axis, str]  #: how the neighbours end: outcome or status
    runs: int  #: how many forms were driven
    notes: tuple[str, ...]  #: what was not tried, and why
    run: Path  #: the run folder of these forms
    _workspace: Workspace = field(repr=False)
    _campaign: Campaign = field(repr=False)  # of the original's run
    _injection: int | None = field(repr=False)  # the number of the only injection

    @property
    def time_to_hazard_s(self) -> float:
        """The time from the start of the fault to the hazard, in s."""
        return round(self.hazard_s - self.start_s, 9)

    @property
    def minimal(self) -> str:
        """What is said of the next smaller forms: `0.04 s and 17 mph are each without the hazard`."""
        texts = [
            _describe_neighbour(axis, neighbour, self.endings[axis])
            for axis, neighbour in self.neighbours.items()
        ]
        if not texts:
            return "nothing smaller can be tried"
        verdict = f"{' and '.join(texts)} {'are each' if len(texts) > 1 else 'is'} without the hazard"
        if self.observed_s is None:
            return verdict
        return f"{verdict}; the drive goes on for {self.observed_s:g} s after the fault"

    def as_json(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {
            **experiment_facts(self.experiment),
            "value": self.experiment.fault.value,
            "unit": self.experiment.fault.unit,
            "injections": len(self.experiment.fault.injections),
            "start_s": self.start_s,
            "duration_s": self.duration_s,
            "hazard": self.hazard,
            "hazard_s": self.hazard_s,
            "time_to_hazard_s": self.time_to_hazard_s,
            "minimal": self.minimal,
            "neighbours": {
                axis.value: {"experiment": neighbour.id, "ending": self.endings[axis]}
                for axis, neighbour in self.neighbours.items()
            },
            "observed_s": self.observed_s,
            "original": {
                **experiment_facts(self.original),
                "start_s": self.original_start_s,
                "hazard_s": self.original_hazard_s,
            },
            "steps": [
                {"what": what, "experiment": step.id, "label": step.label} for what, step in self.steps
            ],
            "runs": self.runs,
            "notes": list(self.notes),
            "run": str(self.run),
        }

    def save(self, name: str) -> tuple[list[Path], str]:
        """Write a campaign of this experiment alone into the library, and a regression that pytest collects
        into `regressions/` beside the library.

        Return the files, and why there is no campaign (empty if there is one). MutatorError for a name that
        is not usable or in use.
        """
        check_free_name(self._workspace, name)
        regression = _regression_file(self._workspace, name)
        open_stored_run(self.run, self._workspace).experiment(self.experiment.id).save_regression(regression)
        try:
            return [regression, self._save_campaign(name)], ""
        except MutatorError as error:
            return [regression], error.got

    def _save_campaign(self, name: str) -> Path:
        manifest = self._workspace.manifest(self._campaign.target)
        return save_single_experiment_campaign(
            self._workspace, manifest, self.experiment, self._campaign, self._injection, name
        )


def check_free_name(workspace: Workspace, name: str) -> None:
    """Raise MutatorError unless `SmallestForm.save` can use this name."""
    check_campaign_name(workspace, name)
    regression = _regression_file(workspace, name)
    if regression.exists():
        raise MutatorError(
            "there is such a file", where=regression, argument="save", remedy="choose another name"
        )


def _regression_file(workspace: Workspace, name: str) -> Path:
    return path_below(workspace.library.parent / "regressions", f"{name}.yaml")


def _describe_neighbour(axis: Axis, experiment: Experiment, ending: str) -> str:
    fault, hold_s = experiment.fault, experiment.trigger.hold_s
    number, unit = (hold_s, "s") if axis is Axis.DURATION else (fault.value, fault.unit)
    text = planned_number_text(float(str(number)), unit)
    if ending == Outcome.HAZARD:
        return f"{text} (which reaches another hazard)"
    return text if ending in _ORDINARY_ENDINGS else f"{text} (which ended as {ending})"
