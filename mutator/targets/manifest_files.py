"""Target manifests as YAML: `fault_library/targets/<name>.yaml`, checked and read into a `TargetManifest`."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import Field

from mutator._common.shipped import SHIPPED_TARGET, shipped_folder
from mutator.config.yaml_files import Source, StrictModel, read
from mutator.targets.manifest import Channel, Film, TargetManifest
from mutator.targets.observation import ObservationModel, read_observation
from mutator.targets.upgrade import OLD, upgraded

SCHEMA = "target/2"


class _ChannelModel(StrictModel, title="A channel"):
    """By its name in the trace."""

    unit: str = Field(description="Its unit, for tables and axes; `-` for none.")
    tolerance: float = Field(
        0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="By how much it may differ from golden and still count as the same.",
    )
    about: str = Field("", description="What it is.")


class _ChangeModel(StrictModel, title="A change"):
    """A change is a list of further arguments, or this, where it makes scenarios the same run."""

    args: list[str] = Field(description="Further arguments.")
    same_in: list[str] = Field(
        min_length=2, description="Scenarios that the change makes the same run: it is driven once."
    )


class _EntryModel(StrictModel, title="The entry"):
    """In the arguments, `{scenario}` is the scenario's file, `{seed}` the seed, `{out}` the folder for trace
    and record, and `{cache}` a folder that all runs of the target share. It may be missing, unwritable or
    damaged, and `mutator cache` deletes from it: a run must come to the same bytes all the same."""

    module: str = Field(description="Run as `python -m`, from the root.")
    args: list[str] = Field(description="Its arguments.")
    stepwise: str | None = Field(
        None,
        description="A function of the module that takes these arguments and gives a run that is driven "
        "step by step: what [faster engines](../explanation/performance.md#which-engine-runs) "
        "need.",
    )
    independent: list[str] = Field(
        default_factory=list,
        description="More arguments, of a run that takes nothing from what other runs left behind: those of "
        "the equivalence check, and of mutants of a file in `reads_itself`.",
    )
    changes: dict[str, list[str] | _ChangeModel] = Field(
        default_factory=dict, description="Name of a change of the scenario -> its arguments."
    )


class _FilmModel(StrictModel, title="Films"):
    """What `mutator show --video` and `--still` need. `{film}`, `{golden}`, `{faulty}`, `{events}`, `{out}`
    and `{t}` in the arguments are filled in."""

    run: list[str] = Field(description="More arguments of the entry, which make a run leave a film.")
    module: str = Field(description="Run as `python -m` to show two films.")
    args: list[str] = Field(description="Its arguments.")
    still: list[str] = Field(description="More of them for a still picture.")


class ManifestModel(StrictModel, title="The file"):
    """How a target is found, run and observed, and what its runs leave behind."""

    name: str = Field(description="Its name, which campaigns use.")
    about: str = Field("", description="What the target is.")
    root: str = Field(
        description="The folder that goes on `sys.path`, relative to this file; or `shipped:target`, the "
        "controller that ships with mutator. `--target` overrides it."
    )
    package: str = Field(description="The import package in it. The probe is added to it as `_fi.py`.")
    files: list[str] = Field(
        description="Globs, relative to the root: what makes up the tree. `**` stands for any folders."
    )
    forbid: list[str] = Field(default_factory=list, description="Globs: no fault may be injected there.")
    reads_itself: list[str] = Field(
        default_factory=list,
        description="Globs: files that a run reads while it runs, as what it caches follows from them. A "
        "mutant of one is run by the reference engine, with the arguments of `entry.independent`.",
    )
    step_s: float = Field(ge=1e-6, allow_inf_nan=False, description="The length of a step of simulation.")
    armed_after_s: float = Field(
        0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="When `mutator try` arms triggers, where nothing else is said.",
    )
    entry: _EntryModel = Field(description="How a run is started.")
    trace_file: str = Field(
        description="The trace's name in `{out}`: an `.npz` with an array for each channel."
    )
    time_channel: str = Field(description="The channel that holds time in s.")
    record_file: str = Field(
        description="The record's name in `{out}`: a JSON file, see [another controller "
        "tree](../how-to/add-a-target.md#what-a-run-leaves-behind)."
    )
    compare: dict[str, _ChannelModel] = Field(
        description="Actuator outputs: one that differs from golden means that the fault manifested."
    )
    plot: dict[str, _ChannelModel] = Field(
        default_factory=dict, description="More channels that are worth a plot."
    )
    observation: ObservationModel = Field(description="Where ground truth is read.")
    hazards: list[str] = Field(description="Names of the hazards that the target checks.")
    alerts: list[str] = Field(
        description="Names of the alerts that count; others that a record has are left out."
    )
    film: _FilmModel | None = Field(None, description="How runs are made watchable; without it they are not.")


def load_manifest(path: Path, root: Path | None = None) -> TargetManifest:
    """Read `fault_library/targets/<name>.yaml`; `root` overrides the one it names."""
    model, source = read(path, ManifestModel, SCHEMA, older={OLD: upgraded})
    folder = (root or _root(path, model.root)).resolve()
    if not folder.is_dir():
        raise source.error(
            ("root",),
            f"no folder {folder}",
            expected=f"the target's source root, relative to this file, or {SHIPPED_TARGET}",
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
        observation=read_observation(model.observation, source, folder),
        hazards=tuple(model.hazards),
        alerts=tuple(model.alerts),
        source=source,
        film=_film(model.film),
    )


def _root(path: Path, root: str) -> Path:
    return shipped_folder() / "target" if root == SHIPPED_TARGET else path.parent / root


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
    """Hazards and alerts have names that tables can take, each once."""
    for key in ("hazards", "alerts"):
        seen = set[str]()
        for i, name in enumerate(getattr(model, key)):
            if not name.isidentifier() or name.lower() in seen:
                raise source.error(
                    (key, i),
                    f"'{name}'",
                    expected="a name of letters, digits and _, once",
                    remedy="rename it",
                )
            seen.add(name.lower())


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
