"""The tolerance table: the allowed differences between a trace and its reference."""

from dataclasses import dataclass
from pathlib import Path

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare.key_figures import FIGURE_MEANINGS
from selfdrive.sim.compare.trace_csv import COLUMN_BY_CHANNEL
from selfdrive.sim.yaml_section import YamlSection, read_yaml

SCHEMA = "replay-tolerances/1"

_KEY_MEANINGS = {
    "schema": f"the format of this file, {SCHEMA}",
    "channels": "the limits of a channel over the whole run",
    "figures": "the limits of key figures",
}
_LIMIT_MEANINGS = {
    "rms": "the root mean square of the difference, in the channel's unit",
    "max": "the largest difference, in the channel's unit",
    "lag_s": "the delay between the traces in seconds",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelLimits:
    """Limits of one channel; None: no limit. `rms` and `max` in the channel's SI unit."""

    rms: float | None = None
    max: float | None = None
    lag_s: float | None = None

    @property
    def listing_threshold(self) -> float | None:
        """The smallest difference worth listing."""
        return self.rms if self.max is None else self.max


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    channel_limits: dict[str, ChannelLimits]
    figure_limits: dict[str, float]


def load_tolerances(path: Path) -> Tolerances:
    """Read the table. Raises ConfigError if it is invalid."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ConfigError(
            str(reason), where=str(path), expected="a readable tolerance table", remedy="check the path"
        ) from None
    root = read_yaml(text, str(path), _KEY_MEANINGS)
    root.text("schema", (SCHEMA,))
    channels = root.section("channels", dict.fromkeys(COLUMN_BY_CHANNEL, "limits of this channel"))
    figures = root.section("figures", FIGURE_MEANINGS)
    return Tolerances(
        channel_limits={
            name: _parse_limits(channels.section(name, _LIMIT_MEANINGS))
            for name in COLUMN_BY_CHANNEL
            if name in channels
        },
        figure_limits={name: figures.number(name, 0.0, 1e9) for name in FIGURE_MEANINGS if name in figures},
    )


def _parse_limits(section: YamlSection) -> ChannelLimits:
    rms, largest, lag = (
        section.number(key, 0.0, 1e9) if key in section else None for key in ("rms", "max", "lag_s")
    )
    if rms is None and largest is None and lag is None:
        section.fail(
            "no limit", f"at least one of {', '.join(_LIMIT_MEANINGS)}", "give one, or leave out the channel"
        )
    return ChannelLimits(rms=rms, max=largest, lag_s=lag)
