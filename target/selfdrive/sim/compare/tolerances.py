"""The tolerance table: the allowed differences between a trace and its reference."""

from dataclasses import dataclass
from pathlib import Path

from selfdrive.common.errors import ConfigError
from selfdrive.sim.compare.key_figures import FIGURES
from selfdrive.sim.compare.trace_csv import BY_CHANNEL
from selfdrive.sim.yaml_section import Section, read_yaml

SCHEMA = "replay-tolerances/1"

_KEYS = {
    "schema": f"the format of this file, {SCHEMA}",
    "channels": "the limits of a channel over the whole run",
    "figures": "the limits of key figures",
}
_LIMIT_KEYS = {
    "rms": "the root mean square of the difference, in the channel's unit",
    "max": "the largest difference, in the channel's unit",
    "lag_s": "the delay between the traces in seconds",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of one channel; None: no limit. `rms` and `max` in the channel's SI unit, `lag` in s."""

    rms: float | None = None
    max: float | None = None
    lag: float | None = None

    @property
    def band(self) -> float | None:
        """The smallest difference worth listing."""
        return self.rms if self.max is None else self.max


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    channels: dict[str, Limits]
    figures: dict[str, float]


def load_tolerances(path: Path) -> Tolerances:
    """Read the table. Raises ConfigError if it is invalid."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise ConfigError(
            str(reason), where=str(path), expected="a readable tolerance table", remedy="check the path"
        ) from None
    root = read_yaml(text, str(path), _KEYS)
    root.text("schema", (SCHEMA,))
    channels = root.section("channels", dict.fromkeys(BY_CHANNEL, "limits of this channel"))
    figures = root.section("figures", FIGURES)
    return Tolerances(
        channels={
            name: _limits(channels.section(name, _LIMIT_KEYS)) for name in BY_CHANNEL if name in channels
        },
        figures={name: figures.number(name, 0.0, 1e9) for name in FIGURES if name in figures},
    )


def _limits(section: Section) -> Limits:
    rms, largest, lag = (
        section.number(key, 0.0, 1e9) if key in section else None for key in ("rms", "max", "lag_s")
    )
    if rms is None and largest is None and lag is None:
        section.fail(
            "no limit", f"at least one of {', '.join(_LIMIT_KEYS)}", "give one, or leave out the channel"
        )
    return Limits(rms=rms, max=largest, lag=lag)
