"""Read target manifests, `fault_library/targets/<name>.yaml`, into `TargetManifest`."""

from collections.abc import Collection
from pathlib import Path

from pydantic import Field

from mutator._common.confined_files import checked_relative_path
from mutator._common.shipped_files import SHIPPED_TARGET_ROOT
from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.actuation_yaml import ActuationModel, build_actuation
from mutator.targets.confined_relative_paths import clean_relative_path
from mutator.targets.hazards_and_metrics_yaml import HazardModel, MetricModel, build_hazards, build_metrics
from mutator.targets.manifest import FilmCommands, TargetManifest
from mutator.targets.manifest_formulas import manifest_condition, manifest_formula
from mutator.targets.message_readers_yaml import MessageReaderModel, build_message_readers
from mutator.targets.observation_yaml import ObservationModel, build_observation
from mutator.targets.overhead_view_yaml import OverheadViewModel, build_overhead_view
from mutator.targets.process_environment import check_environment
from mutator.targets.required_packages import parse_requirements
from mutator.targets.root_package_and_overlay_search import (
    INSTALLED_PREFIX,
    check_only_installed_package,
    checked_package_names,
    find_overlay,
    find_root,
)
from mutator.targets.run_and_film_commands_yaml import EntryModel, ScenarioChangeModel, check_commands
from mutator.targets.severity_yaml import SeverityModel, build_severity
from mutator.targets.trace_and_channels_yaml import ChannelModel, TraceModel, build_channels
from mutator.triggers import temporal_logic

SCHEMA = "target/2"


class ManifestModel(StrictModel, title="The file"):
    """How to find, run and observe a target, and which files its runs write."""

    name: str = Field(
        description="The name that campaigns and `--manifest` use for the target, whatever the file is "
        "called. Each manifest has a name of its own."
    )
    about: str = Field("", description="What the target is.")
    root: str = Field(
        description="The folder to put on `sys.path`, relative to this file. Or `shipped:target`, the "
        "controller that ships with mutator. Or `installed:NAME`, the folder into which pip "
        "installed the import package `NAME`; nothing else there is part of the tree. "
        "`--target` overrides it."
    )
    package: str | None = Field(
        None, description="The import package in the root. The probe is added to it as `_fi.py`."
    )
    packages: list[str] | None = Field(
        None,
        description="Instead of `package`: several import packages, or modules outside packages "
        "(`drive.py`). The probe is then a module next to them, `_fi.py`.",
    )
    files: list[str] | None = Field(
        None,
        min_length=1,
        description="Globs, relative to the root: the files of the tree. `**` also matches across folders. "
        "Default: all files of the packages, including data, and the modules. A link is treated as "
        "the file or folder to which it points, which must be in the root unless the root is "
        "`installed:NAME`.",
    )
    overlay: str | None = Field(
        None,
        description="A folder of glue files, relative to this file or to the library, laid over the root. "
        "All its files are part of the tree, and no fault may be injected there. It must be in the "
        "library, and its links must stay in it. It can contain the entry module and the statement at which "
        "values are observed.",
    )
    forbid: list[str] = Field(
        default_factory=list, description="Globs: files in which no fault may be injected."
    )
    reads_itself: list[str] = Field(
        default_factory=list,
        description="Globs: files of the tree that a run reads, because its cached data depends on them. The "
        "reference engine runs the mutants of such a file, with the arguments of "
        "`entry.independent`.",
    )
    env: dict[str, str] = Field(
        default_factory=dict,
        description="Environment variables of every process that runs the target, in addition to the few "
        "that the harness sets. No other variable of the user's environment is passed on.",
    )
    requires: list[str] = Field(
        default_factory=list,
        description="Installed packages that the target needs, in pip's syntax: `gymnasium>=1.0`. `check`, "
        "`doctor` and `run` report missing packages and wrong versions.",
    )
    step_s: float = Field(ge=1e-6, allow_inf_nan=False, description="The length of a simulation step, in s.")
    armed_after_s: float = Field(
        0.0,
        ge=0.0,
        allow_inf_nan=False,
        description="The time at which `mutator try` arms triggers by default, in s.",
    )
    entry: EntryModel = Field(description="How to start a run.")
    trace: TraceModel | None = Field(None, description="The numbers that a run records.")
    record: str | None = Field(
        None,
        description="The record's file name in `{out}`: a JSON file in which the target reports hazards and "
        "alerts, see [another controller "
        "tree](../how-to/add-a-target.md#what-a-run-leaves-behind).",
    )
    channels: dict[str, ChannelModel] = Field(description="The recorded channels and the role of each.")
    observation: ObservationModel = Field(description="Where the harness reads ground truth.")
    actuation: ActuationModel | None = Field(
        None, description="Where defences change commands. Without it, the target cannot be defended."
    )
    hazards: list[str] | dict[str, HazardModel] = Field(
        description="What a run must avoid: names, and how to find each hazard in the trace; or a list of "
        "names in the record."
    )
    metrics: dict[str, MetricModel] = Field(
        default_factory=dict,
        description="The numbers computed for each run. They are columns of the results.",
    )
    severity: SeverityModel | None = Field(
        None, description="How severe hazards are. Without it, results have no severity class."
    )
    messages: dict[str, MessageReaderModel] = Field(
        default_factory=dict,
        description="Reader -> where it gets its messages. Specs can then name a "
        "[message](fault-spec.md#a-message) instead of a place.",
    )
    scene: OverheadViewModel | None = Field(None, description="How to draw a drive from above.")
    speed: str | None = Field(
        None,
        description="The speed of the car in m/s: a formula over channels and derived values. With it, "
        "results have the highest and lowest speed after an activation.",
    )
    engaged: str | None = Field(
        None,
        description="When the controller drives: a condition over channels and derived values. A run that "
        "ends without it, although its golden run ends with it, is not [survived](../how-to/"
        "find-what-is-survived.md#what-the-cells-mean).",
    )
    alerts: list[str] = Field(
        default_factory=list,
        description="The names of the alerts to use; other alerts in a record are ignored.",
    )
    film: YamlRecord[FilmCommands] | None = Field(
        None, description="How to film runs. Without it, runs cannot be filmed."
    )


def load_manifest(path: Path, root: Path | None = None, overlay: Path | None = None) -> TargetManifest:
    """Read a manifest; `root` and `overlay` override the values in the file."""
    model, source = load_yaml_model(path, ManifestModel, SCHEMA)
    requires = parse_requirements(model.requires, source)
    folder = (root or find_root(model.root, source, requires)).resolve()
    if not folder.is_dir():
        raise source.error(
            ("root",),
            f"no folder {folder}",
            expected=f"the target's source root, relative to this file, or {SHIPPED_TARGET_ROOT}, or "
            f"{INSTALLED_PREFIX}NAME",
            remedy="correct `root`, or give the target with --target or MUTATOR_TARGET",
        )
    _check_names_confined(model, source)
    check_commands(model.entry, model.film, source)
    _check_record_name(model, source)
    _check_event_names(model, source)
    check_environment(model.env, source)
    packages = checked_package_names(model.package, model.packages, source)
    check_only_installed_package(model.root, packages, model.files or (), source)
    changes = model.entry.changes
    trace = model.trace or TraceModel.model_validate({})
    channels = build_channels(model.channels, trace, source)
    observation = build_observation(model.observation, source)
    judgeable_names = observation.names_for_trace_formulas(channel.name for channel in channels)
    _check_criteria_recorded(source, set(observation.variables) - set(judgeable_names))
    metrics = build_metrics(model.metrics, judgeable_names, source, hazards=[*model.hazards])
    rules = build_hazards(
        model.hazards,
        judgeable_names,
        source,
        has_record=model.record is not None,
        step_s=model.step_s,
        metrics=[metric.name for metric in metrics],
    )
    return TargetManifest(
        name=model.name,
        path=path,
        root=folder,
        packages=packages,
        file_globs=tuple(model.files or (p if p.endswith(".py") else f"{p}/**" for p in packages)),
        overlay=overlay or find_overlay(model.overlay, source),
        is_installed=root is None and model.root.startswith(INSTALLED_PREFIX),
        forbidden_globs=tuple(model.forbid),
        env=model.env,
        requires=requires,
        entry_module=model.entry.module,
        entry_args=tuple(model.entry.args),
        stepwise_function=model.entry.stepwise,
        independent_args=tuple(model.entry.independent),
        globs_read_by_runs=tuple(model.reads_itself),
        args_by_change={n: tuple(c if isinstance(c, list) else c.args) for n, c in changes.items()},
        same_scenarios_by_change={
            n: tuple(c.same_in) for n, c in changes.items() if isinstance(c, ScenarioChangeModel)
        },
        step_s=model.step_s,
        armed_after_s=model.armed_after_s,
        trace_file=trace.file,
        time_channel=trace.time,
        channels=channels,
        record_file=model.record,
        observation=observation,
        actuation=build_actuation(model.actuation, source),
        hazard_rules=rules,
        metrics=metrics,
        severity=build_severity(model.severity, rules, metrics, source) if model.severity else None,
        scene=None if model.scene is None else build_overhead_view(model.scene, judgeable_names, source),
        alerts=tuple(model.alerts),
        source=source,
        film=model.film,
        message_readers=build_message_readers(model.messages, source),
        speed=manifest_formula(model.speed, judgeable_names, source, ("speed",)),
        engaged=manifest_condition(model.engaged, judgeable_names, source, ("engaged",)),
    )


def _check_names_confined(model: ManifestModel, source: YamlSource) -> None:
    """Refuse names that point out of the folders to which they belong."""
    with source.locating_errors(("name",)):
        checked_relative_path(model.name, source.path)
    for name in model.entry.changes:
        with source.locating_errors(("entry", "changes", name)):
            checked_relative_path(name, source.path, allow_folders=False)
    for key in ("files", "forbid", "reads_itself"):
        for i, glob in enumerate(getattr(model, key) or ()):
            with source.locating_errors((key, i)):
                clean_relative_path(glob)


def _check_record_name(model: ManifestModel, source: YamlSource) -> None:
    if model.record is not None and Path(model.record).name != model.record:
        raise source.error(
            ("record",),
            f"'{model.record}'",
            expected="a bare file name (of a file in {out})",
            remedy="leave out the folder",
        )


def _check_criteria_recorded(source: YamlSource, unrecorded: Collection[str]) -> None:
    """Check that hazards and metrics use only recorded values, because they are judged on the trace."""
    for key in ("hazards", "metrics"):
        entries = source.data.get(key)
        for name, entry in entries.items() if isinstance(entries, dict) else ():
            for field, text in entry.items() if isinstance(entry, dict) else ():
                names = temporal_logic.names_in_stl(text, unrecorded) if isinstance(text, str) else ()
                if names and field not in ("about", "unit", "source"):
                    raise source.error(
                        (key, name, field),
                        f"'{names[0]}', which is observed but not recorded",
                        expected="only values that follow from the channels",
                        remedy=f"have the run record it, as a channel `{names[0]}` with `role: truth`",
                    )


def _check_event_names(model: ManifestModel, source: YamlSource) -> None:
    for key in ("hazards", "alerts"):
        used_names = set[str]()
        names = getattr(model, key)
        for i, name in enumerate(names):
            if not name.isidentifier() or name.lower() in used_names:
                raise source.error(
                    (key, name if isinstance(names, dict) else i),
                    f"'{name}'",
                    expected="a unique name of letters, digits and _",
                    remedy="rename it",
                )
            used_names.add(name.lower())
