"""Fault specs: what may go wrong in one module, as a YAML file says it, values not yet drawn."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator.model import FaultLocation, Hold
from mutator.yamlio import Keys, Source

AS_DESCRIBED = "as_described"
AS_CODED = "as_coded"
READINGS = (AS_DESCRIBED, AS_CODED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """How a variant's values are made: one draw from each range, or a list taken as it is.

    Values are in `unit`, the unit in the YAML key. `key` seeds the draw: equal keys and ranges give
    equal values.
    """

    key: str
    unit: str
    kind: str  # integers, reals, list
    ranges: tuple[tuple[float, float], ...] = ()
    values: tuple[float | int, ...] = ()
    decimals: int | None = None
    cap: float | None = None

    @property
    def count(self) -> int:
        """How many values it makes."""
        return len(self.values) if self.kind == "list" else len(self.ranges)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A parameter that takes the drawn value, times `sign`; where a reading says that a number written in one
    unit is read as another, through that mistake."""

    sign: int = 1
    written_in: str | None = None
    read_as: str | None = None


ParamValue = int | float | str | bool | None | Drawn


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """A parameter as written: `name` without its unit suffix, `unit` the suffix or None."""

    name: str
    unit: str | None
    value: ParamValue
    keys: Keys  # where it stands in the file


@dataclass(frozen=True, slots=True, kw_only=True)
class InjectionSpec:
    """One injection as written; `target_unit` is the unit of the changed variable (None: SI)."""

    location: FaultLocation
    model: str
    params: tuple[ParamSpec, ...]
    target_unit: str | None
    keys: Keys


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """One row of the library: injections that share a trigger and a draw, in one or both readings."""

    name: str
    aim: str
    about: str
    draw: Draw | None
    hold: Hold | None
    changes: tuple[str, ...]
    readings: Mapping[str, tuple[InjectionSpec, ...]]
    keys: Keys

    def injections(self, reading: str) -> tuple[InjectionSpec, ...]:
        """The injections under `reading`; a variant without `as_coded` is the same in both."""
        return self.readings.get(reading, self.readings[AS_DESCRIBED])

    @property
    def count(self) -> int:
        """Number of faults it expands to."""
        return self.draw.count if self.draw else 1


@dataclass(frozen=True, kw_only=True)
class FaultSpec:
    """One file of `fault_library/faults/<module>/`: a fault type of a module with its variants."""

    module: str
    fault_type: str
    about: str
    variants: tuple[Variant, ...]
    source: Source

    @property
    def name(self) -> str:
        """`<module>/<fault_type>`; its faults carry `<module>/<fault_type>/<variant>` as `Fault.spec`."""
        return f"{self.module}/{self.fault_type}"

    @property
    def path(self) -> Path:
        return self.source.path

    @property
    def count(self) -> int:
        """Number of faults it expands to, in each reading."""
        return sum(v.count for v in self.variants)

    def __iter__(self) -> Iterator[Variant]:
        return iter(self.variants)


def load_spec(path: Path) -> FaultSpec:
    """Read one spec strictly (file:line errors). Models, ranges and anchors are checked by `expand`."""
    raise NotImplementedError
