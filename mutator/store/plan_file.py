"""The frozen plan on disk: one line per experiment, read whole or one chunk at a time."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache, partial
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

from mutator._common.files import raising_disk_full, write_atomic
from mutator._common.hashing import added_values, canonical, content_id, plain
from mutator.errors import MutatorError
from mutator.model import (
    AfterHazard,
    Anchor,
    AnchorKind,
    Experiment,
    Fault,
    FaultLocation,
    Hold,
    Injection,
    Method,
    Trigger,
)

EXPERIMENTS = "plan/experiments.jsonl"
FAULTS = "plan/faults.jsonl"
_REMEDY = "the plan is damaged: take the file from a copy of the run folder, or plan into a new one"

_HASHED = ("fault", "scenario", "scenario_digest", "method", "trigger", "seed", "setting")  # as Experiment.id
_FIELDS = {"id", *_HASHED}

_T = TypeVar("_T")
Chunk = tuple[int, int, int]  # offset and length in bytes, number of experiments


def write(run: Path, experiments: Sequence[Experiment], chunks: Sequence[int]) -> list[Chunk]:
    """Write the plan's files; returns where each chunk is."""
    lines = [canonical(to_plain(experiment)).encode() + b"\n" for experiment in experiments]
    faults = {experiment.fault.id: experiment.fault for experiment in experiments}
    with raising_disk_full(run):
        (run / "plan").mkdir(parents=True, exist_ok=True)
    write_atomic(run / EXPERIMENTS, b"".join(lines))
    write_atomic(run / FAULTS, b"".join(canonical(plain(f)).encode() + b"\n" for f in faults.values()))
    places: list[Chunk] = []
    offset = first = 0
    for count in chunks:
        length = sum(map(len, lines[first : first + count]))
        places.append((offset, length, count))
        offset, first = offset + length, first + count
    return places


_Lines = Iterable[tuple[int | None, bytes]]  # number, where it is known, and text


def _lines(path: Path) -> _Lines:
    return enumerate(lines_of(path), start=1)


def _tried(path: Path, lines: _Lines, made: Callable[[dict[str, Any]], _T]) -> Iterator[_T | MutatorError]:
    """What is `made` of each line of the plan file at `path`, or what is wrong with the line."""
    for number, line in lines:
        try:
            yield made(json.loads(line))
        except MutatorError as err:
            yield MutatorError(err.got, where=path, line=number, expected=err.expected, remedy=err.remedy)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            yield MutatorError("a damaged line", where=path, line=number, remedy=_REMEDY)


def _read(path: Path, lines: _Lines, made: Callable[[dict[str, Any]], _T]) -> Iterator[_T]:
    """As `_tried`, but what is wrong is raised."""
    for found in _tried(path, lines, made):
        if isinstance(found, MutatorError):
            raise found
        yield found


def read_faults(run: Path) -> dict[str, Fault]:
    """The plan's faults by id."""
    path = run / FAULTS
    return {fault.id: fault for fault in _read(path, _lines(path), fault_from)}


def read_chunk(run: Path, chunk: Sequence[int], faults: Mapping[str, Fault]) -> tuple[Experiment, ...]:
    """The experiments of one chunk."""
    offset, length, count = chunk
    path = run / EXPERIMENTS
    with path.open("rb") as file:
        file.seek(offset)
        data = file.read(length)
    lines = ((None, line) for line in data.splitlines())
    found = tuple(_read(path, lines, partial(experiment_from, faults=faults)))
    if len(found) != count:
        raise MutatorError(f"{len(found)} experiments in a chunk of {count}", where=path, remedy=_REMEDY)
    return found


def read_all(run: Path) -> tuple[Experiment, ...]:
    """Every experiment, in the plan's order."""
    path, faults = run / EXPERIMENTS, read_faults(run)
    return tuple(_read(path, _lines(path), partial(experiment_from, faults=faults)))


def lines_of(path: Path) -> Iterator[bytes]:
    """The lines of a plan file, one at a time, with their ends."""
    try:
        with path.open("rb") as file:
            yield from file
    except OSError as err:
        raise MutatorError(f"cannot be read ({err.strerror})", where=path, remedy=_REMEDY) from None


def experiment_on(path: Path, number: int, line: bytes, faults: Mapping[str, Fault]) -> Experiment:
    """The experiment on a line of the plan file at `path`."""
    [experiment] = _read(path, [(number, line)], partial(experiment_from, faults=faults))
    return experiment


def ids(run: Path) -> Iterator[str]:
    """Every experiment's id, in the plan's order."""
    path = run / EXPERIMENTS
    return _read(path, _lines(path), lambda data: str(data["id"]))


def problems(run: Path) -> Iterator[MutatorError]:
    """Every line that is not what its id, or the id by which others name it, stands for."""
    planned, defined = run / EXPERIMENTS, run / FAULTS
    found = list(_tried(defined, _lines(defined), fault_from))
    faults = {fault.id: fault for fault in found if isinstance(fault, Fault)}
    used = set(_tried(planned, _lines(planned), itemgetter("fault")))
    for number, fault in enumerate(found, start=1):
        if isinstance(fault, MutatorError):
            yield fault
        elif fault.id not in used:
            got = f"fault {fault.id}, which no experiment has"
            yield MutatorError(got, where=defined, line=number, remedy=_REMEDY)
    experiments = _tried(planned, _lines(planned), partial(experiment_from, faults=faults))
    yield from (one for one in experiments if isinstance(one, MutatorError))


def to_plain(experiment: Experiment) -> dict[str, Any]:
    """What JSON knows of an experiment; its fault by id."""
    return {
        "id": experiment.id,
        "fault": experiment.fault.id,
        "scenario": experiment.scenario,
        "scenario_digest": experiment.scenario_digest,
        "method": experiment.method.value,
        "trigger": plain(experiment.trigger),
        "seed": experiment.seed,
        "setting": list(experiment.setting),
        **added_values(experiment),
    }


def experiment_from(data: Mapping[str, Any], faults: Mapping[str, Fault]) -> Experiment:
    """The experiment of a plan file's line; MutatorError when its id is not that of its content, and for a
    field that this version does not know."""
    if data["fault"] not in faults:
        raise MutatorError(f"fault {data['fault']} is not in {FAULTS}, or was changed there", remedy=_REMEDY)
    trigger = data["trigger"]
    values = {name: value for name, value in data.items() if name != "id"}
    read = {
        "fault": faults[data["fault"]],
        "method": Method(data["method"]),
        "trigger": _make(Trigger, trigger, hold=Hold(trigger["hold"])),
        "setting": tuple(data["setting"]),
    }
    if "after_hazard" in data:
        read["after_hazard"] = AfterHazard(data["after_hazard"])
    experiment = _make(Experiment, values, **read)
    if not _is_named(data) and experiment.id != data["id"]:
        raise MutatorError(
            f"what is called experiment {data['id']} is {experiment.id}",
            expected="the content that the id was made from",
            remedy=_REMEDY,
        )
    return experiment


def _is_named(data: Mapping[str, Any]) -> bool:
    """Whether the id of a plan file's line is that of its content, asked of the plain data: in half the time
    that it takes to ask the experiment. That one knows what to think of fields that are missing or new."""
    if data.keys() != _FIELDS or data["trigger"].keys() != _known(Trigger):
        return False
    return bool(content_id([data[name] for name in _HASHED]) == data["id"])


def canary_from(head: Path, data: Mapping[str, Any]) -> Experiment:
    """The canary, as the run.json at `head` has it; MutatorError when it is damaged."""
    try:
        fault = fault_from(data["fault"])
        return experiment_from({**data, "fault": fault.id}, {fault.id: fault})
    except (MutatorError, ValueError, LookupError, TypeError, AttributeError) as err:
        raise MutatorError(f"damaged at 'canary' ({err})", where=head, remedy=_REMEDY) from None


def fault_from(data: Mapping[str, Any]) -> Fault:
    """The fault of a plan file's line; MutatorError for a field that this version does not know."""
    return _make(
        Fault,
        data,
        injections=tuple(_injection_from(item) for item in data["injections"]),
        hold=Hold(data["hold"]) if data["hold"] else None,
        changes=tuple(data["changes"]),
    )


def _injection_from(data: Mapping[str, Any]) -> Injection:
    location, anchor = data["location"], data["location"]["anchor"]
    return _make(
        Injection,
        data,
        location=_make(
            FaultLocation, location, anchor=_make(Anchor, anchor, kind=AnchorKind(anchor["kind"]))
        ),
        params=tuple((name, value) for name, value in data["params"]),
    )


def _make(kind: type[_T], data: Mapping[str, Any], /, **read: Any) -> _T:
    """A record from its line, some values of which were `read` already. Fields added since the line was
    written hold their defaults."""
    if unknown := sorted(data.keys() - _known(kind)):  # type: ignore[arg-type]
        raise MutatorError(
            f"{kind.__name__.lower()} has '{unknown[0]}', which this version of mutator does not know",
            expected="a plan that this version or an older one wrote",
            remedy="update mutator, or plan into a new folder",
        )
    return kind(**{**data, **read})


@lru_cache(maxsize=16)
def _known(kind: type[Any]) -> frozenset[str]:
    return frozenset(field.name for field in fields(kind))
