"""The trace and the channels of a manifest."""

from pathlib import Path

from pydantic import Field

from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator.config.phrases_yaml import ChangePhraseModel, build_phrase
from mutator.config.unit_symbol_field import UnitSymbol
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import YamlSource
from mutator.targets.channels import ROUNDING_TOLERANCE, Channel, Role
from mutator.targets.stored_phrases import HIGHEST_SPEED, LOWEST_SPEED
from mutator.triggers.conditions import RESERVED_NAMES


class ChannelModel(StrictModel, title="A channel"):
    """A channel. Conditions, tables and plots use its name."""

    unit: UnitSymbol = Field(
        description="The unit, for tables and axes, as symbol or suffix (`m/s`, `mps`); `-` for none."
    )
    role: Role = Field(
        Role.INTERNAL,
        strict=False,
        description="`actuator`: what the controller commands; if it differs from the golden run, the fault "
        "has manifested. `truth`: the state of the world. `internal`: what the controller "
        "assumes.",
    )
    component: str = Field(
        "",
        description="The component of the controller to which the channel belongs; it must be in the "
        "control structure, if there is one.",
    )
    tolerance: float | None = Field(
        None,
        ge=0.0,
        allow_inf_nan=False,
        description="Differences from the golden run up to this value are ignored. If an actuator differs by "
        "more, the fault has manifested; if a component's channel does, the fault has reached the component. "
        f"Default: 0 for actuators; for other channels {ROUNDING_TOLERANCE:g} of the unit, to ignore "
        "rounding.",
    )
    about: str = Field("", description="What the channel contains.")
    phrase: ChangePhraseModel | None = Field(
        None,
        description="Only for an actuator: what the car does if it is the first to differ from the golden "
        'run, as a clause: `{higher: "the car accelerates to {highest_speed}", lower: ...}`. Holes: '
        "`highest_speed` and `lowest_speed`, which have a value only if the fault made the car faster or "
        "slower. Each direction is a text or a list, as for hazards.",
    )
    times_channel: str = Field(
        "",
        alias="time",
        description="For a channel that is not recorded in each step: the channel that holds its times. If "
        "the trace is a table (`.csv`, `.parquet`), its empty cells are skipped.",
    )
    from_: str = Field(
        "",
        alias="from",
        description="The name in the trace, if it differs. In an `.mcap` file: the topic and the field of "
        "its JSON messages, `/car/state:speed`.",
    )


class TraceModel(StrictModel, title="The trace"):
    """The numbers that a run records."""

    file: str = Field(
        "trace.npz",
        description="The file name in `{out}`: an `.npz` with an array for each channel, a `.csv` or "
        "`.parquet` with a column for each, or an `.mcap` with JSON messages (`pip install "
        "mcap`). Other packages can add more.",
    )
    time: str = Field(
        "t",
        description="The channel that holds the time in s of each step. In an `.mcap` file: the topic that "
        "has a message for each step; its log times are simulated time.",
    )


def build_channels(
    models: dict[str, ChannelModel], trace: TraceModel, source: YamlSource
) -> tuple[Channel, ...]:
    """Read a manifest's channels, in order; MutatorError for an invalid trace or channel."""
    suffix = Path(trace.file).suffix.removeprefix(".")
    if Path(trace.file).name != trace.file or not (suffix and TRACE_IMPORTER_DOOR.has_name(suffix)):
        suffixes = ", ".join(f".{name}" for name in TRACE_IMPORTER_DOOR.names())
        raise source.error(
            ("trace", "file"),
            f"'{trace.file}'",
            expected=f"a bare file name (of a file in {{out}}) that ends in {suffixes}",
            remedy="have the run write such a file, and name it here",
        )
    if not any(model.role is Role.ACTUATOR for model in models.values()):
        raise source.error(
            ("channels",),
            "no channel with `role: actuator`",
            expected="a channel that holds what the controller commands; verdicts depend on it",
            remedy="give a channel the role actuator",
        )
    return tuple(_build_channel(name, model, trace, source) for name, model in models.items())


def _build_channel(name: str, model: ChannelModel, trace: TraceModel, source: YamlSource) -> Channel:
    keys = ("channels", name)
    if name == trace.time:
        raise source.error(keys, f"'{name}'", expected="a channel other than the time", remedy="leave it out")
    if name in RESERVED_NAMES:
        raise source.error(
            keys,
            f"'{name}'",
            expected=f"a name other than these, which formulas already use: {', '.join(RESERVED_NAMES)}",
            remedy=f"choose another name, with `from: {name}`",
        )
    in_topics = trace.file.endswith(".mcap")
    if in_topics and not all(model.from_.partition(":")):
        raise source.error(
            (*keys, "from"),
            f"'{model.from_}'",
            expected="the topic and the field of its messages: `/car/state:speed`",
        )
    if in_topics and model.times_channel:
        raise source.error(
            (*keys, "time"),
            f"'{model.times_channel}'",
            expected="no `time` for an .mcap file, in which each message has its own",
            remedy="leave it out",
        )
    if model.phrase and model.role is not Role.ACTUATOR:
        raise source.error(
            (*keys, "phrase"),
            f"a phrase of a channel with the role {model.role.value}",
            expected="`phrase` only for an actuator",
            remedy="remove it",
        )
    plain = model.model_dump(exclude={"from_", "tolerance", "phrase"})
    phrase = build_phrase(model.phrase, (HIGHEST_SPEED, LOWEST_SPEED), source, (*keys, "phrase"))
    tolerance = model.role.default_tolerance if model.tolerance is None else model.tolerance
    return Channel(name=name, other_trace_name=model.from_, tolerance=tolerance, phrase=phrase, **plain)
