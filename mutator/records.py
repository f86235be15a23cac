"""Records on disk: appended by workers, one file each, read back whatever a kill left behind."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from mutator.model import Record


@dataclass(kw_only=True)
class Progress:
    """How far a run is. `outcomes` counts outcomes of ok experiments and the other statuses by name."""

    stage: str  # "plan", "checks", "experiments", "results"
    detail: str = ""
    done: int = 0
    total: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    elapsed_s: float = 0.0
    remaining_s: float | None = None


def read_records(run: Path) -> dict[str, Record]:
    """The final record of each experiment id that has one (torn last lines are skipped).

    Any other record goes before a harness error. CheckFailed when two final records of one experiment differ.
    """
    raise NotImplementedError
