"""Readings: the interpretations of the same faults that a library declares. Most libraries declare none."""

import re
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from mutator._common.confined_files import checked_path_inside
from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.errors import MutatorError

SCHEMA = "readings/1"
READINGS_FILE = "readings.yaml"  # in a library
_NAME_PATTERN = re.compile(r"[a-z][a-z0-9_]*\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecReadings:
    """The readings of a library, in order. The first is the default, which every variant must define.

    A library that declares none has one without a name.
    """

    names: tuple[str, ...]
    descriptions: tuple[str, ...]

    @property
    def default_name(self) -> str:
        return self.names[0]

    @property
    def are_declared(self) -> bool:
        return self.names != _NO_NAMES

    @property
    def expected_text(self) -> str:
        """What an error about an unknown name expects."""
        return f"one of {', '.join(self.names)}" if self.are_declared else "none: this library declares none"

    def check_name(self, name: str) -> None:
        """Raise MutatorError for an unknown name."""
        if name not in self.names:
            raise MutatorError(
                f"reading '{name}'",
                expected=self.expected_text,
                remedy=self.remedy,
            )

    @property
    def remedy(self) -> str:
        """What to do about an unknown name."""
        verb = "correct the name" if self.are_declared else "leave it out"
        return f"{verb}, or declare the reading in the library's {READINGS_FILE}"


_NO_NAMES = ("",)
NO_READINGS = SpecReadings(names=_NO_NAMES, descriptions=("What a variant injects.",))
"""The readings of a library without a file `readings.yaml`."""
KEY_WITHOUT_NAME = "as_described"
"""The key under which variants of a library without readings can have their injections, too."""


class _DeclaredReadingModel(StrictModel, title="A declared reading"):
    about: str = Field(description="What the reading means.")


class ReadingsModel(StrictModel, title="readings.yaml"):
    """The readings of a library."""

    readings: dict[str, _DeclaredReadingModel] = Field(
        min_length=1,
        description="Name -> reading. A name consists of lowercase letters, digits and `_`. "
        "The first reading is the default.",
    )


def load_readings(library: Path) -> SpecReadings:
    path = checked_path_inside(library, library / READINGS_FILE)
    if not path.is_file():
        return NO_READINGS
    model, source = load_yaml_model(path, ReadingsModel, SCHEMA)
    for name in model.readings:
        if not _NAME_PATTERN.match(name):
            raise source.error(
                ("readings", name),
                f"'{name}'",
                expected="lowercase letters, digits and _",
                remedy="rename it",
            )
    about = tuple(reading.about.strip() for reading in model.readings.values())
    return SpecReadings(names=tuple(model.readings), descriptions=about)
