"""Campaign files: which faults, in which scenarios, under which triggers, within which limits."""

from dataclasses import dataclass
from pathlib import Path

from mutator.model import Method


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What one run may use before it is stopped: seconds of CPU and of wall time, MiB of address space,
    observed simulation steps."""

    cpu_s: int = 60
    wall_s: int = 180
    memory_mb: int = 4096
    steps: int = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Faults taken from the library: specs by glob over `<module>/<fault_type>/<variant>`.

    `values` is how many of a variant's values are taken, spread evenly over them in the order of the spec
    (None: all).
    """

    spec: str
    values: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Canary:
    """A fault known to be harmful: its largest value, active from `at_s` on, must reach `hazard`."""

    spec: str
    scenario: str
    hazard: str
    at_s: float


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A campaign file, checked. Sizes and times are SI; `source_text` is the file as it was read."""

    name: str
    about: str
    path: Path
    source_text: str
    target: str
    scenarios: tuple[str, ...]
    faults: tuple[Selection, ...]
    reading: str
    methods: tuple[Method, ...]
    table: str
    rows: tuple[str, ...] | None
    armed_after_s: float
    random_until_s: float
    sample: int | None
    seed: int
    canary: Canary
    limits: Limits
    chunk: int


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file strictly; MutatorError with file and line for anything wrong with it."""
    raise NotImplementedError
