"""The outcomes of torture cases, as a printed table and a list of failures."""

import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum

from mutator._common.table_rendering import TextTable


class End(StrEnum):
    RIGHT = "right"  # with the undisturbed result
    REFUSED = "refused"  # with an error that names the file and the remedy
    WRONG = "wrong"  # with anything else


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One try: what was damaged and how, what read or resumed it, how that ended, and the details of a
    failure."""

    kind: str
    damage: str
    reader: str
    end: End
    story: str = ""


@dataclass(slots=True)
class Tally:
    """The cases of one torture test. `--seed` repeats one case."""

    title: str
    cases: list[tuple[int, Case]] = field(default_factory=list)

    def drive(self, seeds: Iterable[int], cases_of: Callable[[int], Sequence[Case]]) -> None:
        """Run the seeds. An exception in a case is a failure."""
        for seed in seeds:
            try:
                found = cases_of(seed)
            except Exception:
                story = traceback.format_exc()
                found = [Case(kind="?", damage="?", reader="?", end=End.WRONG, story=story)]
            self.cases += [(seed, case) for case in found]

    @property
    def wrong(self) -> list[str]:
        return [
            f"--seed {seed}: {case.kind}: {case.story}" for seed, case in self.cases if case.end is End.WRONG
        ]

    def __str__(self) -> str:
        heads = [field.name for field in fields(Case)[:3]]
        tables = [self._table(head) for head in heads]
        return "\n\n".join([f"{self.title}: {len(self.cases)} cases", *tables, *self.wrong])

    def _table(self, head: str) -> str:
        counts = Counter((getattr(case, head), case.end) for _, case in self.cases)
        names = sorted({one for one, _ in counts})
        rows = [(one, *(str(counts[one, end]) for end in End)) for one in names]
        total = [str(sum(counts[one, end] for one in names)) for end in End]
        return TextTable(
            heads=(head, *End), rows=[*rows, ("total", *total)], right_aligned=(1, 2, 3)
        ).as_text()
