"""The target manifest: all that the harness knows of a controller tree."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from packaging.requirements import Requirement

from mutator._common import caches
from mutator.config.yaml_files import Source
from mutator.errors import MutatorError
from mutator.targets.channels import Channel, Role
from mutator.targets.judging import Hazard, Metric
from mutator.targets.observation import Observation
from mutator.targets.placeholders import filled
from mutator.targets.scene import Scene
from mutator.targets.severity import DELTA_V, Contact
from mutator.targets.source_tree import SourceTree, matches, read_tree
from mutator.triggers import stl
from mutator.triggers.conditions import names_in

_DELTA_V = Metric(
    name=DELTA_V,
    aggregate="at_end",
    formula="",
    unit="m/s",
    worse="higher",
    about="change of the own speed in the contact, from contact speed and masses",
)
FILM = "film"  # folder in the output of a run that is filmed


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """How a target's runs are made watchable: what makes a run leave a film, and what shows two of them."""

    run_args: tuple[str, ...]  # of the entry module, with {film}
    module: str  # run as `python -m`
    args: tuple[str, ...]  # with {golden}, {faulty} (films), {events}, {out}
    still_args: tuple[str, ...]  # more of them for a still picture, with {t}
    pictures: tuple[str, ...]  # changes with which the controller sees the camera's pictures


@dataclass(frozen=True, kw_only=True)
class TargetManifest:
    """A target: its tree, how to run it, what it records. `root` is absolute.

    An instance is a snapshot: `tree` is read once, so one manifest object never mixes two states of the
    target's sources. Load the manifest again to see an edit.
    """

    name: str
    path: Path  # the manifest file
    root: Path  # absolute source root: goes on sys.path
    packages: tuple[str, ...]  # import packages (`pkg`) and flat modules (`b.py`) in it
    files: tuple[str, ...]  # globs, relative to root: what makes up the tree
    overlay: Path | None  # absolute: a folder of glue that is laid over the root
    forbid: tuple[str, ...]  # globs: no fault may be injected there
    env: Mapping[str, str]  # variables of every process that runs the target
    requires: tuple[Requirement, ...]  # installed packages that the target needs
    entry_module: str  # run as `python -m`
    entry_args: tuple[str, ...]  # with {scenario}, {seed}, {out}, {cache}, {root}
    stepwise: str | None  # function of the entry module: its arguments -> a run to be driven step by step
    independent: tuple[str, ...]  # more arguments, of a run that takes nothing from what others left behind
    reads_itself: tuple[str, ...]  # globs: files that a run reads while it runs, so they must be the mutant's
    changes: Mapping[str, tuple[str, ...]]  # scenario change -> extra arguments
    step_s: float
    armed_after_s: float  # triggers wait so long where nothing else is said: until the controller is at work
    trace_file: str  # in {out}; its suffix says what kind of file it is
    time_channel: str
    channels: tuple[Channel, ...]
    record_file: str | None  # a JSON in {out}, where the target leaves one
    observation: Observation
    rules: tuple[Hazard, ...]
    metrics: tuple[Metric, ...]
    contact: Contact | None  # what makes a contact severe
    scene: Scene | None
    alerts: tuple[str, ...]  # alerts that count in experiments
    source: Source = field(repr=False, compare=False)  # the file's lines, for errors
    film: Film | None = None
    # change -> scenarios that it makes the same: their traffic, say, is all they differ in, and it is gone
    same_in: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def package(self) -> str | None:
        """The package to which mutants add the probe; None: it is a module of its own beside several."""
        first, *others = self.packages
        return None if others or first.endswith(".py") else first

    @property
    def import_names(self) -> tuple[str, ...]:
        """The top-level names of its modules: a run must import them from its own tree."""
        laid_over = sorted(path for path in self.tree.overlaid if path.endswith(".py"))
        names = (*self.packages, *(path.partition("/")[0] for path in laid_over))
        return tuple(dict.fromkeys(name.removesuffix(".py") for name in names))

    @cached_property
    def tree(self) -> SourceTree:
        """The target's files, read once."""
        tree = read_tree(self.root, self.files, self.overlay)
        for name in self.packages:
            if name not in tree.files and not any(path.startswith(f"{name}/") for path in tree.files):
                raise MutatorError(
                    f"no module '{name}' under {self.root}"
                    if name.endswith(".py")
                    else f"no file of package '{name}' under {self.root}",
                    where=self.path,
                    remedy="correct `root`, `package`, `packages` or `files`",
                )
        return tree

    @cached_property
    def compared(self) -> tuple[Channel, ...]:
        """Actuator outputs: one that differs from golden means that the fault manifested."""
        return tuple(channel for channel in self.channels if channel.role is Role.ACTUATOR)

    @cached_property
    def plotted(self) -> tuple[Channel, ...]:
        """The channels that are not compared."""
        return tuple(channel for channel in self.channels if channel.role is not Role.ACTUATOR)

    @cached_property
    def judged(self) -> tuple[Channel, ...]:
        """The channels that hazards and metrics are judged by."""
        channels = [channel.name for channel in self.channels]
        known = self.observation.judgeable(channels)
        needed = self.observation.inputs(_names_of(self.rules, self.metrics, known))
        return tuple(channel for channel in self.channels if channel.name in needed)

    @cached_property
    def hazards(self) -> tuple[str, ...]:
        """The names of the hazards."""
        return tuple(hazard.name for hazard in self.rules)

    @cached_property
    def measures(self) -> tuple[Metric, ...]:
        """All numbers that a run is given: the margins of its hazards, its metrics, delta-v."""
        margins = [hazard.metric for hazard in self.rules if hazard.metric]
        return (*margins, *self.metrics, *([_DELTA_V] if self.contact else []))

    @property
    def outputs(self) -> tuple[str, ...]:
        """The files that a run leaves in {out}."""
        return (self.trace_file, *([self.record_file] if self.record_file else []))

    def reads_any(self, paths: Iterable[str]) -> bool:
        """Whether a run itself reads one of these files: what it caches follows from their content."""
        return any(matches(path, self.reads_itself) for path in paths)

    def arguments(
        self,
        *,
        scenario: Path,
        seed: int,
        out: Path,
        changes: tuple[str, ...] = (),
        independent: bool = False,
    ) -> tuple[str, ...]:
        """The entry module's arguments for one run; MutatorError for a change the target does not know."""
        values = {"scenario": str(scenario), "seed": str(seed), "out": str(out)}
        values |= {"film": str(out / FILM), "cache": str(caches.of_target(self.name)), "root": str(self.root)}
        extra = [*self.independent] if independent else []
        for change in changes:
            if change not in self.changes:
                raise MutatorError(
                    f"change '{change}'",
                    where=self.path,
                    expected=f"one of {', '.join(self.changes) or 'none'}",
                    remedy="add it to the manifest's `changes`, or correct the spec",
                )
            extra += self.changes[change]
        return tuple(filled((*self.entry_args, *extra), values))

    def filming(self) -> "TargetManifest":
        """The same target, whose runs leave a film; MutatorError for a target that cannot be filmed."""
        if self.film is None:
            raise MutatorError(
                f"target {self.name} cannot be filmed",
                where=self.path,
                expected="`film` in its manifest",
                remedy="say there which commands take and show a film",
            )
        return replace(self, entry_args=(*self.entry_args, *self.film.run_args))


def _names_of(rules: Iterable[Hazard], metrics: Iterable[Metric], known: Collection[str]) -> set[str]:
    """What the formulas of hazards and metrics ask for, `known` being all that they can."""
    texts = [text for rule in rules for text in (rule.when, rule.margin, rule.terminal)]
    texts += [text for metric in metrics for text in (metric.formula, metric.where)]
    in_stl = (name for rule in rules for name in stl.names_in(rule.stl, known))
    return {name for text in texts if text for name in names_in(text)}.union(in_stl)
