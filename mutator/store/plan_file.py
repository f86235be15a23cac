"""The frozen plan on disk: one line per experiment, read as a whole or chunk by chunk."""

from bisect import bisect_right
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from hashlib import sha256
from itertools import accumulate, islice
from pathlib import Path
from typing import Any, Protocol, TypeVar, overload

from mutator._common.bounded_reading import bounded_lines, check_open, open_regular
from mutator._common.files import raising_disk_full, writing_atomic
from mutator._common.hashing import added_values, canonical, plain
from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.model import Experiment, Fault
from mutator.store.plan_lines import (
    REMEDY,
    content,
    experiment_from,
    experiment_of,
    fault_from,
    fault_of,
    id_of,
)

EXPERIMENTS = "plan/experiments.jsonl"
FAULTS = "plan/faults.jsonl"

_T = TypeVar("_T")
Chunk = tuple[int, int, int]  # offset and length in bytes, number of experiments


class SupportsWrite(Protocol):
    def write(self, data: bytes, /) -> object: ...


class PlanWriter:
    """Write experiments, and each fault once, to the given files."""

    def __init__(self, experiments: SupportsWrite, faults: SupportsWrite) -> None:
        self.places: list[Chunk] = []
        self._experiments, self._faults = experiments, faults
        self._known: set[str] = set()
        self._offset = 0

    def append(self, experiments: Sequence[Experiment], chunks: Iterable[int]) -> None:
        """Write the experiments of the next chunks, which have these lengths."""
        lines = (canonical(_line(experiment)).encode() + b"\n" for experiment in experiments)
        for count in chunks:
            data = b"".join(islice(lines, count))
            self._experiments.write(data)
            self.places.append((self._offset, len(data), count))
            self._offset += len(data)
        new = {one.fault.id: one.fault for one in experiments if one.fault.id not in self._known}
        self._known.update(new)
        self._faults.write(b"".join(canonical(plain(fault)).encode() + b"\n" for fault in new.values()))


def write(run: Path, experiments: Sequence[Experiment], chunks: Sequence[int]) -> list[Chunk]:
    make_folder(run)
    with writing_atomic(run / EXPERIMENTS) as lines, writing_atomic(run / FAULTS) as faults:
        writer = PlanWriter(lines, faults)
        writer.append(experiments, chunks)
    return writer.places


def make_folder(run: Path) -> None:
    with raising_disk_full(run):
        (run / "plan").mkdir(parents=True, exist_ok=True)


_Lines = Iterable[tuple[int | None, bytes]]  # line number, if known, and text


def _lines(path: Path) -> _Lines:
    return enumerate(lines_of(path), start=1)


def _read(path: Path, lines: _Lines, read: Callable[[bytes], _T]) -> Iterator[_T]:
    """Yield what `read` returns for each line of the plan file at `path`."""
    for number, line in lines:
        try:
            yield read(line)
        except MutatorError as err:
            raise _placed(err, path, number) from None


def _tried(path: Path, read: Callable[[bytes], _T]) -> Iterator[_T | MutatorError]:
    """Yield what `read` returns for each line of the plan file at `path`, or the line's problem."""
    for number, line in _lines(path):
        try:
            yield read(line)
        except MutatorError as err:
            yield _placed(err, path, number)


def _placed(err: MutatorError, path: Path, number: int | None) -> MutatorError:
    return type(err)(err.got, where=path, line=number, expected=err.expected, remedy=err.remedy)


def read_faults(run: Path) -> dict[str, Fault]:
    path = run / FAULTS
    return {fault.id: fault for fault in _read(path, _lines(path), fault_of)}


def fault_lines(run: Path) -> dict[str, bytes]:
    """Return the unparsed lines of the plan's faults by id, which is the digest of the line."""
    lines = (line.rstrip(b"\n") for line in lines_of(run / FAULTS))
    return {sha256(line).hexdigest()[:16]: line for line in lines}


def lines_named(run: Path, names: Container[str]) -> Iterator[bytes]:
    lines = lines_of(run / EXPERIMENTS)
    return (line.rstrip(b"\n") for name, line in zip(ids(run), lines, strict=True) if name in names)


def chunk_lines(run: Path, chunk: Sequence[int]) -> list[bytes]:
    offset, length, _ = chunk
    with open_regular(run / EXPERIMENTS) as file:
        check_open(file, run / EXPERIMENTS)
        file.seek(offset)
        return file.read(length).splitlines()


def read_chunk(run: Path, chunk: Sequence[int], faults: Mapping[str, Fault]) -> tuple[Experiment, ...]:
    path, count = run / EXPERIMENTS, chunk[2]
    found = tuple(_experiments(path, ((None, line) for line in chunk_lines(run, chunk)), faults))
    if len(found) != count:
        got = f"{counted(len(found), 'experiment')} in a chunk of {count}"
        raise MutatorError(got, where=path, remedy=REMEDY)
    return found


def read_all(run: Path) -> tuple[Experiment, ...]:
    return tuple(iterate(run))


class ExperimentsInOrder(Sequence[Experiment]):
    """Every experiment in plan order, read on access, because a plan can have a million experiments."""

    def __init__(self, run: Path, chunks: Sequence[Chunk]) -> None:
        self._run, self._chunks = run, chunks
        self._ends = list(accumulate(count for _, _, count in chunks))

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __iter__(self) -> Iterator[Experiment]:
        return iterate(self._run)

    @overload
    def __getitem__(self, place: int) -> Experiment: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Experiment]: ...
    def __getitem__(self, place: int | slice) -> Experiment | Sequence[Experiment]:
        if isinstance(place, slice):
            return [self[i] for i in range(len(self))[place]]
        at = range(len(self))[place]
        number = bisect_right(self._ends, at)
        chunk = self._chunks[number]
        return read_chunk(self._run, chunk, self._faults)[at - self._ends[number] + chunk[2]]

    @cached_property
    def _faults(self) -> dict[str, Fault]:
        return read_faults(self._run)


def iterate(run: Path) -> Iterator[Experiment]:
    path = run / EXPERIMENTS
    yield from _experiments(path, _lines(path), read_faults(run))


def lines_of(path: Path) -> Iterator[bytes]:
    try:
        with open_regular(path) as file:
            yield from bounded_lines(file, path)
    except OSError as err:
        raise MutatorError(f"cannot be read ({err.strerror})", where=path, remedy=REMEDY) from None


def experiment_on(path: Path, number: int, line: bytes, faults: Mapping[str, Fault]) -> Experiment:
    [experiment] = _experiments(path, [(number, line)], faults)
    return experiment


def _experiments(path: Path, lines: _Lines, faults: Mapping[str, Fault]) -> Iterator[Experiment]:
    return _read(path, lines, partial(experiment_of, faults=faults))


def ids(run: Path) -> Iterator[str]:
    path = run / EXPERIMENTS
    return _read(path, _lines(path), id_of)


def problems(run: Path) -> Iterator[MutatorError]:
    """Yield a problem for each line that is damaged or does not match its id, and for each unused fault."""
    planned, defined = run / EXPERIMENTS, run / FAULTS
    found = list(_tried(defined, fault_of))
    faults = {fault.id: fault for fault in found if isinstance(fault, Fault)}
    used = set(_tried(planned, lambda line: content(line)["fault"]))
    for number, fault in enumerate(found, start=1):
        if isinstance(fault, MutatorError):
            yield fault
        elif fault.id not in used:
            got = f"fault {fault.id}, which no experiment uses"
            yield MutatorError(got, where=defined, line=number, remedy=REMEDY)
    experiments = _tried(planned, partial(experiment_of, faults=faults))
    yield from (one for one in experiments if isinstance(one, MutatorError))


def to_plain(experiment: Experiment) -> dict[str, Any]:
    """Convert an experiment to JSON types, with its fault's id."""
    return {name: plain(value) for name, value in _line(experiment).items()}


def _line(experiment: Experiment) -> dict[str, Any]:
    return {
        "id": experiment.id,
        "fault": experiment.fault.id,
        "scenario": experiment.scenario,
        "scenario_digest": experiment.scenario_digest,
        "method": experiment.method,
        "trigger": experiment.plain_trigger,
        "seed": experiment.seed,
        "setting": experiment.setting,
        **added_values(experiment),
    }


def canary_from(head: Path, data: Mapping[str, Any]) -> Experiment:
    """Read the canary in the run.json at `head`; MutatorError if it is damaged."""
    try:
        fault = fault_from(data["fault"])
        return experiment_from({**data, "fault": fault.id}, {fault.id: fault})
    except (MutatorError, ValueError, LookupError, TypeError, AttributeError) as err:
        raise MutatorError(f"damaged at 'canary' ({err})", where=head, remedy=REMEDY) from None
