"""Golden runs by name: scenario, changes and seed."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from mutator.model import Experiment

# scenario, changes; seed, if the plan has several
StoredGolden = tuple[str, tuple[str, ...]] | tuple[str, tuple[str, ...], int]


class GoldenRun(NamedTuple):
    """A fault-free run: scenario, changes and, if the plan has several seeds, its seed (else None)."""

    scenario: str
    changes: tuple[str, ...] = ()
    seed: int | None = None

    @classmethod
    def for_experiment(cls, experiment: Experiment, *, several_seeds: bool) -> "GoldenRun":
        """Return the golden run with which an experiment is compared."""
        return cls(experiment.scenario, experiment.changes, experiment.seed if several_seeds else None)

    @property
    def key(self) -> str:
        """The run's name: `S1`, `S1+alone`, or `S1+alone@7` with seed 7."""
        name = "+".join((self.scenario, *self.changes))
        return name if self.seed is None else f"{name}@{self.seed}"

    @classmethod
    def from_stored(cls, values: Sequence[Any]) -> "GoldenRun":
        scenario, changes, *seed = values
        return cls(scenario, tuple(changes), *seed)

    def to_stored(self) -> StoredGolden:
        """Return the values as run.json has them."""
        golden = self.scenario, self.changes
        return golden if self.seed is None else (*golden, self.seed)
