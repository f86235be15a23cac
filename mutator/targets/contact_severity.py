"""The severity of a contact: delta-v of the ego car, and its class on a scale."""

from dataclasses import dataclass, field

from mutator._common.hashing import added_field
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata

SEVERITY_CLASSES = ("S0", "S1", "S2", "S3")  # from ISO 26262-3, the mildest first
DELTA_V_NAME = "delta_v"  # name of the metric


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactSettings:
    """How severe a contact is. The metric `delta_v` is the delta-v of the ego car, `contact_speed *
    other_mass_kg / (mass_kg + other_mass_kg)`; the scale assigns its class.
    """

    __pydantic_config__ = pydantic_mapping_config("Severity")

    hazard: str = field(
        metadata=yaml_metadata("The terminal hazard that is a contact with another vehicle.", alias="contact")
    )
    speed_metric: str = field(
        metadata=yaml_metadata(
            "The metric that holds the closing speed at the contact: one with `at_end`, in m/s. If it is "
            "negative, the cars separate, and delta-v is 0.",
            alias="contact_speed",
        )
    )
    mass_kg: float = field(
        metadata=yaml_metadata("The mass of the ego car.", alias="mass_kg", gt=0.0, allow_inf_nan=False)
    )
    other_mass_kg: float = field(
        metadata=yaml_metadata(
            "The mass of the other vehicle.", alias="other_mass_kg", gt=0.0, allow_inf_nan=False
        )
    )
    scale: str = field(
        metadata=yaml_metadata(
            "The name of a file in the library's `severity/`, without `.yaml`; or `collision`, which ships "
            "with mutator."
        )
    )

    def delta_v_mps(self, closing_speed_mps: float) -> float:
        """Return the change of the ego car's speed in m/s, in an inelastic collision along the line of
        travel; 0 if the closing speed is not positive.
        """
        return max(closing_speed_mps, 0.0) * self.other_mass_kg / (self.mass_kg + self.other_mass_kg)


@dataclass(frozen=True, slots=True, kw_only=True)
class SeverityScale:
    """The classes of delta-v: (name, least delta-v in m/s, meaning), the mildest first, beginning at 0.
    `source` cites the bounds. `words` names classes in a word or two: (name, words).
    """

    name: str
    about: str
    source: str
    classes: tuple[tuple[str, float, str], ...]
    words: tuple[tuple[str, str], ...] = added_field(())

    def __post_init__(self) -> None:
        if not any(least <= 0.0 for _, least, _ in self.classes):
            raise ValueError("no class of severity begins at 0")

    @property
    def labels(self) -> dict[str, str]:
        """The classes as people read them, by name: `S2 severe`. S1 alone could also be a scenario."""
        words = dict(self.words)
        return {name: f"{name} {words.get(name) or about}".rstrip() for name, _, about in self.classes}

    def class_of(self, delta_v_mps: float) -> str:
        """Return the class of a delta-v in m/s, 0 or more; a value on a bound is in the upper class."""
        return [name for name, least, _ in self.classes if delta_v_mps >= least][-1]
