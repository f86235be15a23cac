"""Shrinks an experiment of an exploration with the envelopes of its run folder."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from mutator.api.exploration_benches import experiment_builder
from mutator.api.run_contents import RunContents
from mutator.api.run_envelopes import RunEnvelope
from mutator.api.smallest_form import SmallestForm
from mutator.api.target_and_fault_selection import SelectedTarget
from mutator.campaigns.campaign_files import Campaign
from mutator.execution.bench import Bench
from mutator.explore.envelope_shrinking import EnvelopeCell, EnvelopeShrinking
from mutator.explore.exploration_run import BuildExperiment, check_harness
from mutator.explore.lattice import Cell
from mutator.model import Experiment, Record

_NOTE = "the sizes and durations are those of the envelope: between two of them, nothing was tried"


@dataclass(frozen=True, eq=False)
class EnvelopeShrinker:
    """Shrinks an experiment, which is `cell` in the last of the envelopes."""

    run: RunContents
    selected_target: SelectedTarget
    campaign: Campaign
    experiment: Experiment
    record: Record
    envelopes: tuple[RunEnvelope, ...]
    cell: Cell

    @classmethod
    def of_experiment(
        cls,
        run: RunContents,
        selected_target: SelectedTarget,
        campaign: Campaign,
        experiment: Experiment,
        record: Record,
    ) -> "EnvelopeShrinker | None":
        """Return the shrinker for an experiment; None if its run folder has no envelope with it."""
        for number, envelope in enumerate(run.envelopes):
            if envelope.plane.seeds > 1:  # each of its cells has several experiments
                continue
            for cell, result in envelope.exploration.map.results.items():
                if result.experiment_id == experiment.id:
                    simpler = (e for e in run.envelopes[:number] if _differs_in_scenario(e, envelope))
                    envelopes = (*simpler, envelope)
                    return cls(run, selected_target, campaign, experiment, record, envelopes, cell)
        return None

    def shrink(self, open_bench: Callable[[], AbstractContextManager[Bench]], out: Path) -> SmallestForm:
        """Find the smallest form. The bench, in `out`, is opened only if anything must be driven."""
        shrinking = EnvelopeShrinking(
            self.envelopes, self.cell, self.record.hazards[0][0], self.run.folder.records()
        )
        driven: list[EnvelopeCell] = []
        if undriven := shrinking.undriven:
            with open_bench() as bench:
                while undriven:
                    records = bench.run(map(self._build, undriven), "shrinking in an envelope")
                    for place, record in zip(undriven, records, strict=True):
                        check_harness(record)
                        shrinking.note(place, record)
                    driven += undriven
                    undriven = shrinking.undriven
        return self._describe(shrinking, out if shrinking.smallest in driven else self.run.path)

    @cached_property
    def _build_experiment(self) -> BuildExperiment:
        reading, observe_s = self.experiment.fault.reading, self.envelopes[-1].exploration.section.observe_s
        return experiment_builder(self.selected_target, reading, observe_s)

    def _build(self, place: EnvelopeCell) -> Experiment:
        envelope, (line, duration) = self.envelopes[place.envelope], place.cell
        return self._build_experiment(
            envelope.plane, envelope.magnitudes[line], envelope.drive.start_s, envelope.durations_s[duration]
        )

    def _describe(self, shrinking: EnvelopeShrinking, run: Path) -> SmallestForm:
        smallest, original = shrinking.smallest, self.envelopes[-1]
        envelope, hazard = self.envelopes[smallest.envelope], self.record.hazards[0][0]
        drive, duration_s = envelope.drive, envelope.durations_s[smallest.cell[1]]
        experiment, record = self._build(smallest), shrinking.record(smallest)
        ends_s = drive.end_s if experiment.end_s is None else min(drive.end_s, experiment.end_s)
        neighbours = shrinking.neighbours(smallest)
        endings = {axis: shrinking.record(place) for axis, place in neighbours.items()}
        is_original = experiment.id == self.experiment.id
        return SmallestForm(
            original=self.experiment,
            experiment=experiment,
            record=record,
            hazard=hazard,
            start_s=drive.start_s,
            duration_s=duration_s,
            hazard_s=dict(record.hazards)[hazard],
            original_start_s=original.drive.start_s,
            original_hazard_s=self.record.hazards[0][1],
            neighbours={axis: self._build(place) for axis, place in neighbours.items()},
            endings={axis: str(record.outcome or record.status) for axis, record in endings.items()},
            observed_s=round(max(0.0, ends_s - drive.start_s - duration_s), 3),
            steps=() if is_original else (("by the envelope", experiment),),
            runs=shrinking.runs,
            notes=(_NOTE,),
            run=run,
            _workspace=self.run.workspace,
            _campaign=self.campaign,
            _injection=None,
        )


def _differs_in_scenario(envelope: RunEnvelope, original: RunEnvelope) -> bool:
    """Whether an envelope is of the same faults from the same start on, in another scenario."""
    plane = original.plane
    return replace(envelope.plane, scenario=plane.scenario) == plane != envelope.plane
