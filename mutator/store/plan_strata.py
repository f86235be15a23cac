"""The strata of a plan from which a sample was drawn, and how large they are: `plan/strata.jsonl`.

Each experiment of a sample stands for the others of its stratum, so shares of the whole plan need these
sizes. The file follows from the campaign and its library; the seal does not cover it.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import canonical_json, parse_json
from mutator.errors import MutatorError
from mutator.model import Experiment
from mutator.store.plan_lines import DAMAGED_PLAN_REMEDY

STRATA_FILE = "plan/strata.jsonl"
Stratum = tuple[str, ...]


class SampleDraw(StrEnum):
    """How a sample was drawn."""

    EVEN = "even"  # each variant equally often
    PROPORTIONAL = "proportional"  # each fault type in each scenario in proportion to its size


def stratum_of(draw: SampleDraw, spec: str, family_or_scenario: str, method: str) -> Stratum:
    """Return the stratum of an experiment: variant and method, or fault type, scenario and method."""
    if draw is SampleDraw.EVEN:
        return spec, method
    return spec.rpartition("/")[0], family_or_scenario, method


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanStrata:
    """The number of experiments of each stratum before the draw."""

    draw: SampleDraw
    size_by_stratum: Mapping[Stratum, int]

    @classmethod
    def of_experiments(cls, draw: SampleDraw, experiments: Iterable[Experiment]) -> "PlanStrata":
        return cls(
            draw=draw,
            size_by_stratum=Counter(
                stratum_of(draw, e.fault.spec, e.family_or_scenario, e.method.value) for e in experiments
            ),
        )

    def __add__(self, other: "PlanStrata") -> "PlanStrata":
        sizes = Counter(self.size_by_stratum)
        sizes.update(other.size_by_stratum)
        return PlanStrata(draw=self.draw, size_by_stratum=sizes)

    @property
    def experiment_count(self) -> int:
        return sum(self.size_by_stratum.values())

    def file_bytes(self) -> bytes:
        """Return the content of the file: how the sample was drawn, then a line for each stratum."""
        lines: list[dict[str, object]] = [{"draw": self.draw.value}]
        lines += [{"experiments": n, "stratum": name} for name, n in sorted(self.size_by_stratum.items())]
        return b"".join(canonical_json(line).encode() + b"\n" for line in lines)


def load_strata(run: Path) -> PlanStrata | None:
    """Return the strata of a run folder; None without a sample. MutatorError for a damaged file."""
    path = run / STRATA_FILE
    if not path.is_file():
        return None
    data = read_bounded(path)
    try:
        head, *lines = map(parse_json, data.splitlines())
        sizes = {tuple(line["stratum"]): line["experiments"] for line in lines}
        strata = PlanStrata(draw=SampleDraw(head["draw"]), size_by_stratum=sizes)
        if strata.file_bytes() != data or not all(type(n) is int and n > 0 for n in sizes.values()):
            raise ValueError("not canonical")
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise MutatorError("not the strata of a plan", where=path, remedy=DAMAGED_PLAN_REMEDY) from None
    return strata
