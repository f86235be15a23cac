"""The severity of a contact: delta-v of the ego car, and its class on a scale."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

CLASSES = ("S0", "S1", "S2", "S3")  # from ISO 26262-3, the mildest first
DELTA_V = "delta_v"  # name of the metric


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """How severe a contact is. `hazard` is the terminal hazard, and `speed` the metric of the closing speed
    (m/s). Masses are in kg; `scale` names the scale of the classes.
    """

    hazard: str
    speed: str
    mass: float
    other_mass: float
    scale: str

    def delta_v(self, closing: float) -> float:
        """Return the change of the ego car's speed in m/s, in an inelastic collision along the line of
        travel; 0 if the closing speed is not positive.
        """
        return max(closing, 0.0) * self.other_mass / (self.mass + self.other_mass)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The classes of delta-v: (name, least delta-v in m/s, meaning), the mildest first, beginning at 0.
    `source` cites the bounds.
    """

    name: str
    about: str
    source: str
    classes: tuple[tuple[str, float, str], ...]

    @classmethod
    def from_plain(cls, data: Mapping[str, Any]) -> "Scale":
        classes = tuple((name, float(least), about) for name, least, about in data["classes"])
        return cls(name=data["name"], about=data["about"], source=data["source"], classes=classes)

    def plain(self) -> dict[str, Any]:
        told = {"name": self.name, "about": self.about, "source": self.source}
        return told | {"classes": [list(one) for one in self.classes]}

    def class_of(self, delta_v: float) -> str:
        """Return the class of a delta-v in m/s, 0 or more; a value on a bound is in the upper class."""
        return [name for name, least, _ in self.classes if delta_v >= least][-1]
