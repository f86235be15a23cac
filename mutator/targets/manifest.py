"""The target manifest: all that the harness knows about a controller tree."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from packaging.requirements import Requirement

from mutator._common import cache_layout_and_pruning
from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import digest
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError
from mutator.targets.actuation import Actuation
from mutator.targets.channels import Channel, Role
from mutator.targets.command_placeholders import fill_placeholders
from mutator.targets.hazard_and_metric_definitions import Hazard, Metric
from mutator.targets.hazard_severity import DELTA_V_NAME, ContactSettings, SeveritySettings
from mutator.targets.message_readers import MessageReader
from mutator.targets.observed_values import Observation
from mutator.targets.overhead_view import OverheadView
from mutator.targets.source_tree import SourceTree, matches_any_glob, read_tree
from mutator.triggers import temporal_logic
from mutator.triggers.conditions import GOLDEN_PREFIX, names_in

_DELTA_V_METRIC = Metric(
    name=DELTA_V_NAME,
    aggregate="at_end",
    step_formula="",
    unit="m/s",
    worse="higher",
    about="change of the car's speed in the contact, from contact speed and masses",
)
FILM_FOLDER = "film"  # the output folder of a filmed run
DEFENCE_REPORT_FILE = "defences.json"  # in {out}: what the defences did, written by the harness


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmCommands:
    """The commands for `mutator show --video` and `--still`. In `run`, `{film}` is the folder for the film.
    In `args` and `still`, `{golden}` and `{faulty}` are two films, `{events}` is a JSON file of events, and
    `{out}` the file to write. In `run_for_still` and `still`, `{t}` is the time of a still in s.
    """

    __pydantic_config__ = pydantic_mapping_config("Films")

    run_args: tuple[str, ...] = field(
        metadata=yaml_metadata(
            "Extra arguments of the entry that make a run write a film.", alias="run", strict=False
        )
    )
    run_for_still_args: tuple[str, ...] = field(
        default=(),
        metadata=yaml_metadata(
            "More extra arguments of the entry for a run that is filmed only for stills, once for each "
            "still. The film then needs only the pictures nearest to these times, for a time after its end "
            "the last one. Without these arguments, it has all.",
            alias="run_for_still",
            strict=False,
        ),
    )
    module: str = field(metadata=yaml_metadata("The module that shows two films. It is run as `python -m`."))
    args: tuple[str, ...] = field(metadata=yaml_metadata("The module's arguments.", strict=False))
    still_args: tuple[str, ...] = field(
        metadata=yaml_metadata("Extra arguments for a still.", alias="still", strict=False)
    )
    pictures: tuple[str, ...] = field(
        default=(),
        metadata=yaml_metadata(
            "The entry's changes that make the controller use camera images. After a run, stills are made "
            "automatically for the worst experiments with one of these changes.",
            strict=False,
        ),
    )


@dataclass(frozen=True, kw_only=True)
class TargetManifest:
    """A target: its tree, how to run it, what it records.

    `tree` is read once, so an object never mixes two states of the sources. To see an edit, load the manifest
    again.
    """

    name: str
    path: Path
    root: Path  # absolute source root, added to sys.path
    packages: tuple[str, ...]  # import packages (`pkg`) and flat modules (`b.py`) in it
    file_globs: tuple[str, ...]  # globs, relative to the root: the files of the tree
    overlay: Path | None  # absolute: a folder of glue files laid over the root
    is_installed: bool  # whether the root is where pip installs packages, so that links may lead anywhere
    forbidden_globs: tuple[str, ...]  # globs: files in which no fault may be injected
    env: Mapping[str, str]
    requires: tuple[Requirement, ...]
    entry_module: str  # module, run as `python -m`
    entry_args: tuple[str, ...]  # with {scenario}, {seed}, {out}, {cache}, {root}
    stepwise_function: str | None  # function of the entry module: arguments -> a steppable run
    independent_args: tuple[str, ...]  # extra arguments for a run that must not use data left by other runs
    globs_read_by_runs: tuple[str, ...]  # globs: files of the tree whose content a run reads
    args_by_change: Mapping[str, tuple[str, ...]]  # scenario change -> extra arguments
    step_s: float
    armed_after_s: float  # by default, triggers are armed at this time, when the controller is ready
    trace_file: str  # the trace in {out}; its suffix gives the format
    time_channel: str
    channels: tuple[Channel, ...]
    record_file: str | None  # a JSON file in {out}, if the target writes one
    observation: Observation
    hazard_rules: tuple[Hazard, ...]
    metrics: tuple[Metric, ...]
    severity: SeveritySettings | None
    scene: OverheadView | None
    alerts: tuple[str, ...]  # other alerts are ignored
    source: YamlSource = field(repr=False, compare=False)  # the file's lines, for errors
    film: FilmCommands | None = None
    # change -> scenarios that it makes identical, e.g. because they differ only in traffic that it removes
    same_scenarios_by_change: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    message_readers: Mapping[str, MessageReader] = field(default_factory=dict)
    speed: str = ""  # formula of the car's speed in m/s
    engaged: str = ""  # condition that holds while the controller drives
    sandbox: bool = False  # whether the target's code runs in a sandbox
    actuation: Actuation | None = None  # where defences change commands
    defences: Mapping[str, str] = field(default_factory=dict)  # in its tree: name -> digest, as they act
    defence_files: Mapping[str, bytes] = field(default_factory=dict)  # new and changed files, by path

    @property
    def probe_package(self) -> str | None:
        """The package to which mutants add the probe; None if the probe is a top-level module."""
        first, *others = self.packages
        return None if others or first.endswith(".py") else first

    @property
    def import_names(self) -> tuple[str, ...]:
        """The top-level names of the target's modules, which a run must import from its own tree."""
        laid_over = sorted(path for path in self.tree.overlaid_paths if path.endswith(".py"))
        added = sorted(path for path in self.defence_files if path.endswith(".py"))
        names = (*self.packages, *(path.partition("/")[0] for path in (*laid_over, *added)))
        return tuple(dict.fromkeys(name.removesuffix(".py") for name in names))

    @cached_property
    def tree(self) -> SourceTree:
        library = self.path.parent.parent
        tree = read_tree(
            self.root, self.file_globs, self.overlay, library=library, any_links=self.is_installed
        )
        for name in self.packages:
            if name not in tree.files and not any(path.startswith(f"{name}/") for path in tree.files):
                raise MutatorError(
                    f"no module '{name}' under {self.root}"
                    if name.endswith(".py")
                    else f"no file of package '{name}' under {self.root}",
                    where=self.path,
                    remedy="correct `root`, `package`, `packages` or `files`, or give the root with --target",
                )
        return tree.with_changes(self.defence_files) if self.defence_files else tree

    @cached_property
    def compared_channels(self) -> tuple[Channel, ...]:
        """The actuator channels. A fault has manifested if one of them differs from the golden run."""
        return tuple(channel for channel in self.channels if channel.role is Role.ACTUATOR)

    @cached_property
    def non_actuator_channels(self) -> tuple[Channel, ...]:
        return tuple(channel for channel in self.channels if channel.role is not Role.ACTUATOR)

    @cached_property
    def criteria_channels(self) -> tuple[Channel, ...]:
        """The channels that hazards, metrics and the speed use."""
        channels = [channel.name for channel in self.channels]
        names = self.observation.names_for_trace_formulas(channels)
        needed = self.observation.names_with_inputs(
            _names_used_in_criteria(self.hazard_rules, self.metrics, names)
            | {name for text in (self.speed, self.engaged) if text for name in names_in(text)}
        )
        return tuple(channel for channel in self.channels if channel.name in needed)

    @cached_property
    def hazard_names(self) -> tuple[str, ...]:
        return tuple(hazard.name for hazard in self.hazard_rules)

    @cached_property
    def all_metrics(self) -> tuple[Metric, ...]:
        """The margins of the hazards, the metrics and delta-v."""
        margins = [hazard.margin_metric for hazard in self.hazard_rules if hazard.margin_metric]
        return (*margins, *self.metrics, *([_DELTA_V_METRIC] if self.contact else []))

    @property
    def contact(self) -> ContactSettings | None:
        """The contact that has a delta-v."""
        return self.severity.contact if self.severity else None

    @property
    def output_files(self) -> tuple[str, ...]:
        """The files of a run in {out}."""
        named = (self.trace_file, *([self.record_file] if self.record_file else []))
        return (*named, DEFENCE_REPORT_FILE) if self.defences else named

    def run_reads_any(self, paths: Iterable[str]) -> bool:
        """Whether a run reads one of these files, so that its caches depend on it."""
        return any(matches_any_glob(path, self.globs_read_by_runs) for path in paths)

    def run_arguments(
        self,
        *,
        scenario: Path,
        seed: int,
        out: Path,
        changes: tuple[str, ...] = (),
        independent: bool = False,
    ) -> tuple[str, ...]:
        """Return the entry module's arguments for one run; MutatorError for an unknown change."""
        values = {"scenario": str(scenario), "seed": str(seed), "out": str(out)}
        values |= {"film": str(out / FILM_FOLDER), "cache": str(self.cache_folder), "root": str(self.root)}
        extra = [*self.independent_args] if independent else []
        for change in changes:
            if change not in self.args_by_change:
                raise MutatorError(
                    f"change '{change}'",
                    where=self.path,
                    expected=f"one of {', '.join(self.args_by_change)}"
                    if self.args_by_change
                    else "no change",
                    remedy="add it to the manifest's `changes`, or correct the spec",
                )
            extra += self.args_by_change[change]
        return tuple(fill_placeholders((*self.entry_args, *extra), values))

    @cached_property
    def cache_name(self) -> str:
        """The name of the cache that runs share. In a sandbox, no other code or manifest writes to it."""
        if not self.sandbox:
            return self.name
        return f"{self.name}-{digest(self.tree.digest.encode() + read_bounded(self.path))[:16]}"

    @property
    def cache_folder(self) -> Path:
        """The folder `{cache}`, which need not exist."""
        return cache_layout_and_pruning.target_cache_folder(self.cache_name)

    def paths_read_by_runs(self) -> tuple[Path, ...]:
        """Return what runs read besides their tree, scenario and cache: the target's root, if an argument
        names it.
        """
        words = (
            *self.entry_args,
            *self.independent_args,
            *(word for args in self.args_by_change.values() for word in args),
        )
        return (self.root,) if any("{root}" in word for word in words) else ()

    def with_film_recording(self, still_times: Iterable[float] = ()) -> "TargetManifest":
        """Return the same target, with runs that write a film, or only what stills at `still_times` (s) need.
        MutatorError if it cannot be filmed.
        """
        if self.film is None:
            raise MutatorError(
                f"target {self.name} cannot be filmed",
                where=self.path,
                expected="`film` in its manifest",
                remedy="add the commands that record and show a film",
            )
        for_stills = (
            word.replace("{t}", str(t)) for t in still_times for word in self.film.run_for_still_args
        )
        return replace(self, entry_args=(*self.entry_args, *self.film.run_args, *for_stills))


def _names_used_in_criteria(
    rules: Iterable[Hazard], metrics: Iterable[Metric], names: Collection[str]
) -> set[str]:
    texts = [text for rule in rules for text in (rule.when, rule.margin, rule.terminal_condition)]
    texts += [text for metric in metrics for text in (metric.step_formula, metric.where)]
    in_stl = (name for rule in rules for name in temporal_logic.names_in_stl(rule.required_stl, names))
    return {name.removeprefix(GOLDEN_PREFIX) for text in texts if text for name in names_in(text)}.union(
        in_stl
    )
