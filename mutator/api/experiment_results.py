"""One experiment: what was injected, the verdict, and the golden and the faulty run."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from mutator.api.notebook_html import diff_html, facts_html, text_html
from mutator.figures.golden_and_faulty_plot import draw_golden_and_faulty, event_marks
from mutator.model import Experiment, Fault, Outcome, Record, Status, Trigger
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.outcomes.fault_paths import FaultPathFinder
from mutator.outcomes.trace_and_record_loading import Trace, values_on_steps
from mutator.outcomes.trace_files import own_times
from mutator.outcomes.verdict_rules import (
    classified_hazard_of,
    manifestation_to_hazard_time,
    missing_severity_reason,
    reaction_time,
    severity_class_of,
    time_to_hazard,
)
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn
from mutator.results.plan_columns import PlanColumn
from mutator.results.table_columns import row_of
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_target_facts import ChannelFacts

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TraceFrames:
    """The golden and the faulty run as pandas frames: one column per channel, indexed by time in s.

    `attrs["units"]` of a frame maps each channel in the manifest to its unit.
    """

    golden: "pd.DataFrame"  #: the golden run
    faulty: "pd.DataFrame"  #: the faulty run

    def __repr__(self) -> str:
        rows, columns = self.golden.shape
        return f"<TraceFrames: {columns} channels, {rows} steps golden, {len(self.faulty)} faulty>"

    @property
    def difference(self) -> "pd.DataFrame":
        """Faulty minus golden, at the times that both runs have."""
        times = self.golden.index.intersection(self.faulty.index)
        # floats, because flags cannot be subtracted
        return self.faulty.loc[times].astype(float) - self.golden.loc[times].astype(float)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ExperimentResult(ABC):
    experiment: Experiment  #: the experiment
    record: Record | None  #: its record; None before it has run

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id}: {self.experiment.label}: {self.ending}>"

    def _repr_html_(self) -> str:
        return (
            text_html(repr(self))
            + text_html(self.sentence)
            + diff_html(self.diff)
            + facts_html(self._notebook_facts())
        )

    def _notebook_facts(self) -> list[tuple[str, object]]:
        facts = experiment_facts(self.experiment) | (self.verdict if self.record else {"status": "not run"})
        if facts.get("severity"):
            facts["severity"] = self.severity_label
        texts = {
            name: ", ".join(f"{k} {v if isinstance(v, str) else f'{v:.4g}'}" for k, v in value.items())
            or None  # which `facts_html` leaves out
            for name, value in facts.items()
            if isinstance(value, dict)
        }
        return list((facts | texts).items())

    @property
    def id(self) -> str:
        """The experiment's id."""
        return self.experiment.id

    @property
    def fault(self) -> Fault:
        """The injected fault."""
        return self.experiment.fault

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return self.experiment.scenario

    @property
    def trigger(self) -> Trigger:
        """When the fault is active."""
        return self.experiment.trigger

    @property
    def outcome(self) -> Outcome | None:
        """The effect of the fault; None unless the run ended normally."""
        return self.record.outcome if self.record else None

    @property
    def status(self) -> Status | None:
        """Whether the experiment itself worked; None until it has run."""
        return self.record.status if self.record else None

    @property
    def ending(self) -> str:
        """The outcome; without one, the status or `not run`."""
        return str(self.outcome or self.status or "not run")

    @property
    def verdict(self) -> dict[str, Any]:
        """The verdict as plain data. Times are simulation times in s; None: no such event."""
        return verdict_facts(self.record, self.scale) if self.record else {"status": None}

    @property
    def severity_label(self) -> str:
        """The highest severity class of a hazard, in words: `severe (severity S2)`; empty without a class."""
        name = severity_class_of(self.record, self.scale) if self.record else None
        return self.scale.labels[name] if self.scale and name else ""

    @property
    def severity_basis(self) -> str:
        """The values from which the severity class follows: `delta-v 9.77 m/s`; empty without a class."""
        worst = classified_hazard_of(self.record, self.scale) if self.record else None
        if not self.record or not self.scale or not worst:
            return ""
        return self.scale.describe_values_behind_class(worst.hazard, dict(self.record.metrics))

    @property
    def sentence(self) -> str:
        """What happened, in words: the fault, what the car did, hazards and alerts; until it has run, what
        the fault does.
        """
        sentences = self._sentences()
        if self.record is None:
            return sentences.fault_clause(self.fault)
        finished = FinishedExperiment(self.experiment, self.record, self.scale, self._fault_paths())
        return sentences.sentence(row_of(self._columns(), finished), self.fault)

    @property
    @abstractmethod
    def scale(self) -> SeverityScale | None:
        """The severity scale; None for a target without one."""

    @property
    @abstractmethod
    def patch(self) -> str:
        """The whole patch, including the probe."""

    @property
    def diff(self) -> str:
        """The source diff without the probe, for reading."""
        return patch_without_new_files(self.patch)[0]

    def propagation(self) -> "pd.DataFrame":
        """Return the channels that differ from the golden run, earliest first: name (index), component, role,
        unit, time of the first difference (`t_first`, s), largest difference up to the end of the drive
        (`max_dev`). Empty until the experiment has run.
        """
        import pandas as pd

        facts = {c.name: (c.component, c.role.value, c.unit) for c in self._channels()}
        departures = sorted(self.record.left if self.record else (), key=lambda departure: departure[1])
        rows = [(name, *facts.get(name, ("", "", "")), first, largest) for name, first, largest in departures]
        heads = ["channel", "component", "role", "unit", "t_first", "max_dev"]
        return pd.DataFrame(rows, columns=heads).set_index("channel")

    def plot(self) -> "Figure":
        """Plot the golden and the faulty run: one panel for each channel of the manifest, and event marks."""
        golden, faulty = self._load_traces()
        facts = experiment_facts(self.experiment)
        title = f"{facts['fault']}   {facts['scenario']}   {facts['trigger']}   [{self.id}]"
        marks = event_marks(self.record) if self.record else ()
        end = self.record.t_end if self.record else None
        return draw_golden_and_faulty(golden, faulty, self._manifest(), title=title, marks=marks, end=end)

    @abstractmethod
    def _sentences(self) -> ExperimentSentences: ...

    @abstractmethod
    def _columns(self) -> Sequence[PlanColumn | ResultColumn]: ...

    def _fault_paths(self) -> FaultPathFinder | None:
        return None

    @abstractmethod
    def _channels(self) -> Sequence[ChannelFacts]: ...

    @abstractmethod
    def _manifest(self) -> TargetManifest: ...

    @abstractmethod
    def _load_traces(self) -> tuple[Trace, Trace]: ...


def trace_frame(trace: Trace, manifest: TargetManifest) -> "pd.DataFrame":
    """Return a trace as a frame indexed by time in s; `attrs["units"]` has the units of its channels.

    A channel without a value at a given time keeps its last value.
    """
    import pandas as pd

    time = manifest.time_channel
    time_channels = {own_times(name) for name in trace}
    names = [name for name in trace if name != time and name not in time_channels]
    columns = {name: values_on_steps(trace, name, trace[time]) for name in names}
    frame = pd.DataFrame(columns, index=pd.Index(trace[time], name=time))
    frame.attrs["units"] = {
        c.name: c.unit for c in (*manifest.compared_channels, *manifest.non_actuator_channels)
    }
    return frame


def experiment_facts(experiment: Experiment) -> dict[str, Any]:
    """Describe the experiment as plain data."""
    fault, trigger = experiment.fault, experiment.trigger
    hold = fault.hold or trigger.hold
    return {
        "experiment": experiment.id,
        "fault": fault.label,
        "aim": fault.aim,
        "reading": fault.reading,
        "scenario": " ".join((experiment.scenario_label, *experiment.changes)),
        "method": experiment.method.value,
        "trigger": f"{trigger.name}: {trigger.condition}",
        "armed_after_s": trigger.armed_after_s,
        "hold": hold.value,
        "seed": experiment.seed,
    }


def verdict_facts(record: Record, scale: SeverityScale | None) -> dict[str, Any]:
    """Return the verdict as plain data. Times are simulation times in s; None: no such event.

    `largest_difference` covers the whole run, `difference_in_drive` only the time up to the end of the drive.
    """
    activation, classified = record.activation, classified_hazard_of(record, scale)
    return {
        "status": record.status.value,
        "outcome": record.outcome.value if record.outcome else None,
        "detail": record.detail,
        "error": asdict(record.error) if record.error else None,
        "activated_s": activation.first if activation else None,
        "active_until_s": activation.last if activation else None,
        "activations": activation.count if activation else 0,
        "manifested_s": record.t_manifest,
        "hazards_s": dict(record.hazards),
        "alerts_s": dict(record.alerts),
        "reaction_time_s": reaction_time(record.hazards, record.alerts),
        "severity": classified.severity if classified else None,
        "severity_hazard": classified.hazard if classified else None,
        "no_severity": missing_severity_reason(record, scale),
        "time_to_hazard_s": time_to_hazard(record),
        "manifest_to_hazard_s": manifestation_to_hazard_time(record),
        "largest_difference": dict(record.max_dev),
        # the other order would undo the limit: `dev` replaces values of the whole run
        "difference_in_drive": dict(record.max_dev) | dict(record.dev),
        "drive_ended_s": record.t_end,
        "metrics": dict(record.metrics),
        "trace_digest": record.trace_digest,
    }
