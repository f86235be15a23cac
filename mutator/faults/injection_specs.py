"""Injections as written in YAML."""

import math
import re
from dataclasses import dataclass

from mutator.config import units
from mutator.config.yaml_source_lines import KeyPath
from mutator.model import FaultLocation

_DRAW_REFERENCE_PATTERN = re.compile(r"(-?)([a-z][a-z0-9_]*)\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawReference:
    """A parameter with the drawn value `name`, multiplied by `sign`.

    With `written_in` and `read_as`, the value is converted to the first unit and then misread as the second.
    """

    name: str
    sign: int = 1
    written_unit: str | None = None
    misread_unit: str | None = None


ParamValue = int | float | str | bool | None | DrawReference


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """A parameter as written: `name` without its unit suffix, `unit` the suffix or None.

    A constant that `is_literal` keeps its value: it is no draw's name, and an integer stays one.
    """

    name: str
    unit: str | None
    value: ParamValue
    keys: KeyPath  # its position in the file
    is_literal: bool = False

    @property
    def key(self) -> str:
        return f"{self.name}_{self.unit}" if self.unit else self.name


@dataclass(frozen=True, slots=True, kw_only=True)
class MessagePlace:
    """A topic and who reads it, as the target's manifest declares them."""

    topic: str
    reader: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InjectionSpec:
    """One injection as written. `unit` is the unit of the changed variable, if the model needs it.

    It has a location, or a message for which `message_places` finds one in the manifest.
    """

    location: FaultLocation | None
    model: str
    params: tuple[ParamSpec, ...]
    unit: str | None
    keys: KeyPath
    message: MessagePlace | None = None
    where: str | None = None
    call: int | None = None
    every: int | None = None


def parse_draw_reference(text: str) -> DrawReference | None:
    """Parse `distance` or `-distance` as a reference to the draw of that name."""
    match = _DRAW_REFERENCE_PATTERN.match(text)
    return DrawReference(name=match[2], sign=-1 if match[1] else 1) if match else None


def convert_drawn_value(drawn: DrawReference, number: float, unit: units.Unit, target: units.Unit) -> float:
    """Convert the drawn `number` from `unit` to `target`; ValueError if the units are incompatible."""
    number = math.copysign(1.0, drawn.sign) * number
    if drawn.written_unit and drawn.misread_unit:
        number = units.convert_unit(number, unit, units.UNITS[drawn.written_unit])
        unit = units.UNITS[drawn.misread_unit]
    return units.convert_unit(number, unit, target)
