"""The target manifest: all that the harness knows of a controller tree."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from pydantic import Field

from mutator._common import caches
from mutator.config.yaml_files import Source, StrictModel, read
from mutator.errors import MutatorError
from mutator.outcomes.columns import COLUMNS
from mutator.targets.observation import Observation, ObservationModel, observation
from mutator.targets.source_tree import SourceTree, matches, read_tree

SCHEMA = "target/1"
FILM = "film"  # folder in the output of a run that is filmed


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A recorded channel: its unit for axis labels, and by how much it may differ from golden (0: exact)."""

    name: str
    unit: str
    tolerance: float = 0.0
    about: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """How a target's runs are made watchable: what makes a run leave a film, and what shows two of them."""

    run_args: tuple[str, ...]  # of the entry module, with {film}
    module: str  # run as `python -m`
    args: tuple[str, ...]  # with {golden}, {faulty} (films), {events}, {out}
    still_args: tuple[str, ...]  # more of them for a still picture, with {t}


@dataclass(frozen=True, kw_only=True)
class TargetManifest:
    """A target: its tree, how to run it, what it records. `root` is absolute.

    An instance is a snapshot: `tree` is read once, so one manifest object never mixes two states of the
    target's sources. Load the manifest again to see an edit.
    """

    name: str
    path: Path  # the manifest file
    root: Path  # absolute source root: goes on sys.path
    package: str  # the import package in it; the probe becomes <package>/_fi.py
    files: tuple[str, ...]  # globs, relative to root: what makes up the tree
    forbid: tuple[str, ...]  # globs: no fault may be injected there
    entry_module: str  # run as `python -m`
    entry_args: tuple[str, ...]  # with {scenario}, {seed}, {out}, {cache}
    stepwise: str | None  # function of the entry module: its arguments -> a run to be driven step by step
    independent: tuple[str, ...]  # more arguments, of a run that takes nothing from what others left behind
    reads_itself: tuple[str, ...]  # globs: files that a run reads while it runs, so they must be the mutant's
    changes: Mapping[str, tuple[str, ...]]  # scenario change -> extra arguments
    step_s: float
    armed_after_s: float  # triggers wait so long where nothing else is said: until the controller is at work
    trace_file: str  # an .npz in {out}
    time_channel: str
    compared: tuple[Channel, ...]  # actuator outputs: differing from golden means manifested
    plotted: tuple[Channel, ...]  # others worth a plot
    record_file: str  # a JSON in {out}
    observation: Observation
    hazards: tuple[str, ...]
    alerts: tuple[str, ...]  # alerts that count in experiments
    film: Film | None = None
    # change -> scenarios that it makes the same: their traffic, say, is all they differ in, and it is gone
    same_in: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @cached_property
    def tree(self) -> SourceTree:
        """The target's files, read once."""
        tree = read_tree(self.root, self.files)
        if not any(path.startswith(f"{self.package}/") for path in tree.files):
            raise MutatorError(
                f"no file of package '{self.package}' under {self.root}",
                where=self.path,
                remedy="correct `root`, `package` or `files`",
            )
        return tree

    def reads_any(self, paths: Iterable[str]) -> bool:
        """Whether a run itself reads one of these files: what it caches follows from their content."""
        return any(matches(path, self.reads_itself) for path in paths)

    @property
    def probe_path(self) -> str:
        """Path of the probe in a mutated tree, relative to its root."""
        return f"{self.package}/_fi.py"

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
        places = {"{scenario}": str(scenario), "{seed}": str(seed), "{out}": str(out)}
        places |= {"{film}": str(out / FILM), "{cache}": str(caches.of_target(self.name))}
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
        filled = [places.get(argument, argument) for argument in self.entry_args]
        return (*filled, *extra)

    def filming(self) -> "TargetManifest":
        """The same target, whose runs leave a film; MutatorError for a target that cannot be filmed."""
        if self.film is None:
            raise MutatorError(
                f"target {self.name} cannot be filmed",
                where=self.path,
                expected="`film` in its manifest",
                remedy="say there which commands take and show a film",
            )
        return replace(self, entry_args=(*self.entry_args, *self.film.run_args), stepwise=None)


class _ChannelModel(StrictModel):
    unit: str
    tolerance: float = Field(0.0, ge=0.0, allow_inf_nan=False)
    about: str = ""


class _ChangeModel(StrictModel):
    args: list[str]
    same_in: list[str] = Field(min_length=2)


class _EntryModel(StrictModel):
    module: str
    args: list[str]
    stepwise: str | None = None
    independent: list[str] = Field(default_factory=list)
    changes: dict[str, list[str] | _ChangeModel] = Field(default_factory=dict)


class _FilmModel(StrictModel):
    run: list[str]
    module: str
    args: list[str]
    still: list[str]


class ManifestModel(StrictModel):
    """A manifest file, but for its key `schema`."""

    name: str
    about: str = ""
    root: str
    package: str
    files: list[str]
    forbid: list[str] = Field(default_factory=list)
    reads_itself: list[str] = Field(default_factory=list)
    step_s: float = Field(gt=0.0, allow_inf_nan=False)
    armed_after_s: float = Field(0.0, ge=0.0, allow_inf_nan=False)
    entry: _EntryModel
    trace_file: str
    time_channel: str
    record_file: str
    compare: dict[str, _ChannelModel]
    plot: dict[str, _ChannelModel] = Field(default_factory=dict)
    observation: ObservationModel
    hazards: list[str]
    alerts: list[str]
    film: _FilmModel | None = None


def load_manifest(path: Path, root: Path | None = None) -> TargetManifest:
    """Read `fault_library/targets/<name>.yaml`; `root` overrides the one it names."""
    model, source = read(path, ManifestModel, SCHEMA)
    folder = (root or path.parent / model.root).resolve()
    if not folder.is_dir():
        raise source.error(
            ("root",),
            f"no folder {folder}",
            expected="the target's source root, relative to this file",
            remedy="correct `root`, or give the target with --target or MUTATOR_TARGET",
        )
    _check_names(model, source)
    _check_events(model, source)
    changes = model.entry.changes
    return TargetManifest(
        name=model.name,
        path=path,
        root=folder,
        package=model.package,
        files=tuple(model.files),
        forbid=tuple(model.forbid),
        entry_module=model.entry.module,
        entry_args=tuple(model.entry.args),
        stepwise=model.entry.stepwise,
        independent=tuple(model.entry.independent),
        reads_itself=tuple(model.reads_itself),
        changes={n: tuple(c if isinstance(c, list) else c.args) for n, c in changes.items()},
        same_in={n: tuple(c.same_in) for n, c in changes.items() if isinstance(c, _ChangeModel)},
        step_s=model.step_s,
        armed_after_s=model.armed_after_s,
        trace_file=model.trace_file,
        time_channel=model.time_channel,
        compared=_channels(model.compare),
        plotted=_channels(model.plot),
        record_file=model.record_file,
        observation=observation(model.observation, source, folder),
        hazards=tuple(model.hazards),
        alerts=tuple(model.alerts),
        film=_film(model.film),
    )


def _check_names(model: ManifestModel, source: Source) -> None:
    if not model.package.isidentifier():
        raise source.error(("package",), f"'{model.package}'", expected="a Python package's name")
    for key, command in (("entry", model.entry), ("film", model.film)):
        if command and not all(part.isidentifier() for part in command.module.split(".")):
            raise source.error((key, "module"), f"'{command.module}'", expected="a dotted module name")
    if (stepwise := model.entry.stepwise) is not None and not stepwise.isidentifier():
        raise source.error(("entry", "stepwise"), f"'{stepwise}'", expected="a function of the entry module")
    for key in ("trace_file", "record_file"):
        name = getattr(model, key)
        if Path(name).name != name:
            raise source.error((key,), f"'{name}'", expected="a bare file name, made in {out}")


def _check_events(model: ManifestModel, source: Source) -> None:
    """Hazards become columns of the results, alerts one cell's words: names that fit there, each once."""
    for key in ("hazards", "alerts"):
        names = [name.lower() for name in getattr(model, key)]
        for i, name in enumerate(names):
            taken = key == "hazards" and name not in ("h1", "h2", "h3") and {name, f"t_{name}"} & {*COLUMNS}
            if not name.isidentifier() or taken or name in names[:i]:
                raise source.error(
                    (key, i),
                    f"'{getattr(model, key)[i]}'",
                    expected="a name of letters, digits and _, once, that is no column of the results",
                    remedy="rename it",
                )


def _channels(channels: Mapping[str, _ChannelModel]) -> tuple[Channel, ...]:
    return tuple(Channel(name=name, **channel.model_dump()) for name, channel in channels.items())


def _film(model: _FilmModel | None) -> Film | None:
    if model is None:
        return None
    return Film(
        run_args=tuple(model.run),
        module=model.module,
        args=tuple(model.args),
        still_args=tuple(model.still),
    )
