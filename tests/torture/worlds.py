"""Run folders to damage. Each case gets a copy of one, always at the same path."""

import random
import shutil
import signal
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from types import FrameType

from mutator.audit.run_digests_and_seal import seals_of
from mutator.errors import MutatorError
from mutator.store.run_folder import RunFolder

from .damages import DAMAGES, damage
from .readers import TABLES, Place, Reader, Told, expect
from .tally import Case, End

LONGEST_S = 180  # of a case, on a busy machine
LAST = 1500  # characters of a reader's output in the report


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """A folder `home` with run folders, which stays unchanged, and the readers of its copy at `place`."""

    home: Path
    place: Place
    readers: Mapping[str, Reader]
    damages: Sequence[str] = tuple(sorted(DAMAGES))
    reseal: Callable[[Path], None] | None = None  # recomputes all digests of a damaged folder
    right: dict[str, Told] = field(default_factory=dict)  # the readers' output for the undamaged folder

    def cases(self, seed: int) -> list[Case]:
        chance = random.Random(seed)
        reader = chance.choice(sorted(self.readers))
        right = self._right(reader)
        with self._copied():
            kinds = kinds_of(self.home)
            kind = chance.choice(sorted(kinds))
            how, touched = damage(self.place.folder, kinds[kind], chance, self.damages)
            told = self._tell(reader) if self.reseal is None else self._resealed(reader)
        # if digests.json is damaged, or all digests match, the error can name any file
        at_large = kind == "digests.json" or self.reseal is not None
        touched += TABLES if kind in ("records", "timings") else ()  # derived from both
        named = ["seal", *kinds, *chain(*kinds.values())] if at_large else touched
        end, why = judged(told, right, named)
        story = f"{how} of {', '.join(touched)}, then {reader}: {why}\n{told.said[-LAST:]}"
        return [Case(kind=kind, damage=how, reader=reader, end=end, story=story)]

    def _resealed(self, reader: str) -> Told:
        """Return a reader's output for a folder with recomputed digests, if the damage allows that. Only the
        seal reveals a changed result."""
        assert self.reseal
        with suppress(MutatorError, AttributeError, KeyError, TypeError, ValueError):
            self.reseal(self.place.run)
        told = self._tell(reader)
        if told.code == 0 and told.result != self.right[reader].result:
            known = RunFolder.open(self.place.genuine)
            return expect(self.place, str(seals_of(known).seal))
        return told

    def _right(self, reader: str) -> Told:
        if reader not in self.right:
            with self._copied():
                self.right[reader] = self._tell(reader)
            assert self.right[reader].code == 0, f"{reader}: {self.right[reader].said}"
        return self.right[reader]

    def _tell(self, reader: str) -> Told:
        with limited(LONGEST_S):
            return self.readers[reader](self.place)

    @contextmanager
    def _copied(self) -> Iterator[None]:
        shutil.copytree(self.home, self.place.folder, symlinks=True)
        try:
            yield
        finally:
            shutil.rmtree(self.place.folder)


def kinds_of(home: Path) -> dict[str, list[str]]:
    """Return the files below a folder by kind. The files in one subfolder of a run folder are one kind."""
    found = defaultdict(list)
    for path in sorted(home.rglob("*")):
        if path.is_file():
            name = path.relative_to(home)
            found["/".join(name.parts[1:2]) if len(name.parts) > 1 else name.name].append(name.as_posix())
    return dict(found)


def judged(told: Told, right: Told, touched: Iterable[str]) -> tuple[End, str]:
    if "Traceback" in told.said or "bug in mutator" in told.said:
        return End.WRONG, "a traceback"
    if told.code == 0:
        same = told.result == right.result
        return (End.RIGHT, "") if same else (End.WRONG, f"a different result: {_difference(told, right)}")
    if told.code not in (1, 2, 3):
        return End.WRONG, f"exit code {told.code}"
    if not any(Path(name).name in told.said for name in touched):
        return End.WRONG, "no file is named"
    if not any(words in told.said for words in ("to do: ", "expected: ")) and told.code == 2:
        return End.WRONG, "no remedy is given"
    return End.REFUSED, ""


def _difference(told: Told, right: Told) -> str:
    if isinstance(right.result, list) and isinstance(told.result, list):
        pairs = [pair for pair in zip(told.result, right.result, strict=False) if pair[0] != pair[1]]
        return "; ".join(f"{_first(*pair)}" for pair in pairs)
    if isinstance(right.result, dict) and isinstance(told.result, dict):
        names = right.result.keys() | told.result.keys()
        return ", ".join(name for name in names if right.result.get(name) != told.result.get(name))
    return f"{told.result} instead of {right.result}"[:2000]


def _first(told: object, right: object) -> str:
    lines = zip(str(told).splitlines(), str(right).splitlines(), strict=False)
    one, other = next((pair for pair in lines if pair[0] != pair[1]), (told, right))
    return f"{one!s:.500}, not {other!s:.500}"


class TooLong(Exception):
    """A time limit is exceeded. Unlike a TimeoutError, this is not an OSError, because readers expect
    those."""


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    def end(number: int, frame: FrameType | None) -> None:
        raise TooLong(f"took more than {seconds} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
