"""The frozen plan on disk: one line per experiment, read as a whole or chunk by chunk."""

import json
from bisect import bisect_right
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from hashlib import sha256
from itertools import accumulate, islice
from pathlib import Path
from typing import Any, Protocol, TypeVar, overload

from mutator._common.bounded_reading import check_file_size, open_regular
from mutator._common.files import raising_disk_full, writing_atomic
from mutator._common.hashing import as_json_types, canonical_json, non_default_added_fields
from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.model import Experiment, Fault
from mutator.store.plan_lines import (
    DAMAGED_PLAN_REMEDY,
    experiment_from_json,
    fault_from_json,
    id_on_line,
    parse_experiment,
    parse_fault,
    read_plan_lines,
    values_hashed_into_id,
)
from mutator.store.planned_scenarios import PlannedScenarios, planned_scenarios_of

EXPERIMENTS_FILE = "plan/experiments.jsonl"
FAULTS_FILE = "plan/faults.jsonl"
BATCHES_FILE = "plan/batches.jsonl"  # of a bench

_T = TypeVar("_T")
Chunk = tuple[int, int, int]  # offset and length in bytes, number of experiments


class SupportsWrite(Protocol):
    def write(self, data: bytes, /) -> object: ...


class PlanWriter:
    """Write experiments, and each fault once, to the given files."""

    def __init__(self, experiments: SupportsWrite, faults: SupportsWrite) -> None:
        self.chunks: list[Chunk] = []
        self._experiments, self._faults = experiments, faults
        self._written_fault_ids: set[str] = set()
        self._offset = 0

    def append(self, experiments: Sequence[Experiment], chunk_lengths: Iterable[int]) -> None:
        """Write the experiments of the next chunks, which have these lengths."""
        lines = map(experiment_line, experiments)
        for count in chunk_lengths:
            data = b"".join(islice(lines, count))
            self._experiments.write(data)
            self.chunks.append((self._offset, len(data), count))
            self._offset += len(data)
        new_faults = {
            planned.fault.id: planned.fault
            for planned in experiments
            if planned.fault.id not in self._written_fault_ids
        }
        self._written_fault_ids.update(new_faults)
        self._faults.write(b"".join(map(fault_line, new_faults.values())))


def experiment_line(experiment: Experiment) -> bytes:
    return canonical_json(_line_values(experiment)).encode() + b"\n"


def fault_line(fault: Fault) -> bytes:
    return canonical_json(as_json_types(fault)).encode() + b"\n"


def write_plan(run: Path, experiments: Sequence[Experiment], chunk_lengths: Sequence[int]) -> list[Chunk]:
    create_plan_folder(run)
    with writing_atomic(run / EXPERIMENTS_FILE) as lines, writing_atomic(run / FAULTS_FILE) as faults:
        writer = PlanWriter(lines, faults)
        writer.append(experiments, chunk_lengths)
    return writer.chunks


def create_plan_folder(run: Path) -> None:
    with raising_disk_full(run):
        (run / "plan").mkdir(parents=True, exist_ok=True)


_NumberedLines = Iterable[tuple[int | None, bytes]]  # line number, if known, and text


def _numbered_lines(path: Path) -> _NumberedLines:
    return enumerate(read_plan_lines(path), start=1)


def _parse_lines(path: Path, lines: _NumberedLines, parse: Callable[[bytes], _T]) -> Iterator[_T]:
    """Yield what `parse` returns for each line of the plan file at `path`."""
    for number, line in lines:
        try:
            yield parse(line)
        except MutatorError as err:
            raise _error_with_place(err, path, number) from None


def _parsed_or_error(path: Path, parse: Callable[[bytes], _T]) -> Iterator[_T | MutatorError]:
    """Yield what `parse` returns for each line of the plan file at `path`, or the line's problem."""
    for number, line in _numbered_lines(path):
        try:
            yield parse(line)
        except MutatorError as err:
            yield _error_with_place(err, path, number)


def _error_with_place(err: MutatorError, path: Path, number: int | None) -> MutatorError:
    return type(err)(err.got, where=path, line=number, expected=err.expected, remedy=err.remedy)


def load_faults(run: Path) -> dict[str, Fault]:
    path = run / FAULTS_FILE
    return {fault.id: fault for fault in _parse_lines(path, _numbered_lines(path), parse_fault)}


def fault_line_by_id(run: Path) -> dict[str, bytes]:
    """Return the unparsed lines of the plan's faults by id, which is the digest of the line."""
    lines = (line.rstrip(b"\n") for line in read_plan_lines(run / FAULTS_FILE))
    return {sha256(line).hexdigest()[:16]: line for line in lines}


def selected_experiment_lines(run: Path, selected_ids: Container[str]) -> Iterator[bytes]:
    lines = read_plan_lines(run / EXPERIMENTS_FILE)
    return (
        line.rstrip(b"\n")
        for name, line in zip(experiment_ids(run), lines, strict=True)
        if name in selected_ids
    )


def read_chunk_lines(run: Path, chunk: Sequence[int]) -> list[bytes]:
    offset, length, _ = chunk
    with open_regular(run / EXPERIMENTS_FILE) as file:
        check_file_size(file, run / EXPERIMENTS_FILE)
        file.seek(offset)
        return file.read(length).splitlines()


def load_chunk(run: Path, chunk: Sequence[int], faults: Mapping[str, Fault]) -> tuple[Experiment, ...]:
    path, count = run / EXPERIMENTS_FILE, chunk[2]
    lines = ((None, line) for line in read_chunk_lines(run, chunk))
    experiments = tuple(_with_concrete_scenarios(run, _parse_experiments(path, lines, faults)))
    if len(experiments) != count:
        got = f"{counted(len(experiments), 'experiment')} in a chunk of {count}"
        raise MutatorError(got, where=path, remedy=DAMAGED_PLAN_REMEDY)
    return experiments


def load_experiments(run: Path) -> tuple[Experiment, ...]:
    return tuple(iterate_experiments(run))


class ExperimentsReadOnAccess(Sequence[Experiment]):
    """Every experiment in plan order, read on access, because a plan can have a million experiments."""

    def __init__(self, run: Path, chunks: Sequence[Chunk]) -> None:
        self._run, self._chunks = run, chunks
        self._ends = list(accumulate(count for _, _, count in chunks))
        self._loaded_number, self._loaded = -1, tuple[Experiment, ...]()  # the chunk that was read last

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __iter__(self) -> Iterator[Experiment]:
        return iterate_experiments(self._run)

    @overload
    def __getitem__(self, place: int) -> Experiment: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Experiment]: ...
    def __getitem__(self, place: int | slice) -> Experiment | Sequence[Experiment]:
        if isinstance(place, slice):
            return [self[i] for i in range(len(self))[place]]
        at = range(len(self))[place]
        number = bisect_right(self._ends, at)
        if number != self._loaded_number:  # most are read one after another
            self._loaded = load_chunk(self._run, self._chunks[number], self._faults)
            self._loaded_number = number
        return self._loaded[at - self._ends[number] + len(self._loaded)]

    @cached_property
    def _faults(self) -> dict[str, Fault]:
        return load_faults(self._run)


def iterate_experiments(run: Path) -> Iterator[Experiment]:
    path = run / EXPERIMENTS_FILE
    yield from _with_concrete_scenarios(
        run, _parse_experiments(path, _numbered_lines(path), load_faults(run))
    )


def _with_concrete_scenarios(run: Path, experiments: Iterable[Experiment]) -> Iterator[Experiment]:
    planned = planned_scenarios_of(run)
    return (with_concrete_scenario(experiment, planned) for experiment in experiments)


def with_concrete_scenario(experiment: Experiment, planned: PlannedScenarios | None) -> Experiment:
    """Return the experiment with its scenario, if that is one of the `planned` ones."""
    of_family = planned.by_name.get(experiment.scenario) if planned else None
    if of_family is None:
        return experiment
    with_scenario = replace(experiment, concrete=of_family.scenario)
    vars(with_scenario)["id"] = experiment.id  # the scenario is not hashed into it
    return with_scenario


def parse_experiment_line(path: Path, number: int, line: bytes, faults: Mapping[str, Fault]) -> Experiment:
    [experiment] = _parse_experiments(path, [(number, line)], faults)
    return experiment


def _parse_experiments(
    path: Path, lines: _NumberedLines, faults: Mapping[str, Fault]
) -> Iterator[Experiment]:
    return _parse_lines(path, lines, partial(parse_experiment, faults=faults))


def experiment_ids(run: Path) -> Iterator[str]:
    path = run / EXPERIMENTS_FILE
    return _parse_lines(path, _numbered_lines(path), id_on_line)


def last_batch_digest(run: Path) -> str:
    """Return the digest of the last line of a bench's batches, and so of all of them."""
    last = b""
    for line in read_plan_lines(run / BATCHES_FILE):
        last = line
    return sha256(last).hexdigest()


def batch_problems(run: Path, experiment_count: int) -> Iterator[MutatorError]:
    """Yield a problem for each line of a bench's batches that does not follow from the line before, and if
    they do not add up to the plan.
    """
    path, before, total = run / BATCHES_FILE, "", 0
    for number, line in enumerate(read_plan_lines(path), start=1):
        try:
            values = json.loads(line)
            batch, count, reason = (values[name] for name in ("batch", "experiments", "reason"))
            has_types = type(batch) is type(count) is int and isinstance(reason, str)
            follows = has_types and count > 0 and batch == number and values["before"] == before
        except (ValueError, LookupError, TypeError, RecursionError):
            follows = False
        if not follows:
            got = "a line that does not follow from the line before"
            yield MutatorError(got, where=path, line=number, remedy=DAMAGED_PLAN_REMEDY)
            return
        before, total = sha256(line).hexdigest(), total + count
    if total != experiment_count:
        yield MutatorError(
            f"batches of {counted(total, 'experiment')}",
            where=path,
            expected=f"{experiment_count}, as in {EXPERIMENTS_FILE}",
            remedy=DAMAGED_PLAN_REMEDY,
        )


def plan_problems(run: Path) -> Iterator[MutatorError]:
    """Yield a problem for each line that is damaged or does not match its id, and for each unused fault."""
    experiments_path, faults_path = run / EXPERIMENTS_FILE, run / FAULTS_FILE
    faults_or_errors = list(_parsed_or_error(faults_path, parse_fault))
    faults = {fault.id: fault for fault in faults_or_errors if isinstance(fault, Fault)}
    used = set(_parsed_or_error(experiments_path, lambda line: values_hashed_into_id(line)["fault"]))
    for number, fault in enumerate(faults_or_errors, start=1):
        if isinstance(fault, MutatorError):
            yield fault
        elif fault.id not in used:
            got = f"fault {fault.id}, which no experiment uses"
            yield MutatorError(got, where=faults_path, line=number, remedy=DAMAGED_PLAN_REMEDY)
    experiments = _parsed_or_error(experiments_path, partial(parse_experiment, faults=faults))
    yield from (experiment for experiment in experiments if isinstance(experiment, MutatorError))


def experiment_as_json(experiment: Experiment) -> dict[str, Any]:
    """Convert an experiment to JSON types, with its fault's id."""
    return {name: as_json_types(value) for name, value in _line_values(experiment).items()}


def _line_values(experiment: Experiment) -> dict[str, Any]:
    return {
        "id": experiment.id,
        "fault": experiment.fault.id,
        "scenario": experiment.scenario,
        "scenario_digest": experiment.scenario_digest,
        "method": experiment.method,
        "trigger": experiment.trigger_as_json,
        "seed": experiment.seed,
        "setting": experiment.setting,
        **non_default_added_fields(experiment),
    }


def canary_from_json(head_path: Path, data: Mapping[str, Any]) -> Experiment:
    """Read the canary in the run.json at `head_path`; MutatorError if it is damaged."""
    try:
        fault = fault_from_json(data["fault"])
        return experiment_from_json({**data, "fault": fault.id}, {fault.id: fault})
    except (MutatorError, ValueError, LookupError, TypeError, AttributeError) as err:
        raise MutatorError(
            f"damaged at 'canary' ({err})", where=head_path, remedy=DAMAGED_PLAN_REMEDY
        ) from None
