"""The frozen plan on disk: one line per experiment, read whole or one chunk at a time."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from mutator._common.files import raising_disk_full, write_atomic
from mutator._common.hashing import added_values, canonical, plain
from mutator.errors import MutatorError
from mutator.model import (
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

_EXPERIMENTS = "plan/experiments.jsonl"
_FAULTS = "plan/faults.jsonl"

_T = TypeVar("_T")
Chunk = tuple[int, int, int]  # offset and length in bytes, number of experiments


def write(run: Path, experiments: Sequence[Experiment], chunks: Sequence[int]) -> list[Chunk]:
    """Write the plan's files; returns where each chunk is."""
    lines = [canonical(to_plain(experiment)).encode() + b"\n" for experiment in experiments]
    faults = {experiment.fault.id: experiment.fault for experiment in experiments}
    with raising_disk_full(run):
        (run / "plan").mkdir(parents=True, exist_ok=True)
    write_atomic(run / _EXPERIMENTS, b"".join(lines))
    write_atomic(run / _FAULTS, b"".join(canonical(plain(f)).encode() + b"\n" for f in faults.values()))
    places: list[Chunk] = []
    offset = first = 0
    for count in chunks:
        length = sum(map(len, lines[first : first + count]))
        places.append((offset, length, count))
        offset, first = offset + length, first + count
    return places


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as err:
        raise MutatorError(
            f"cannot be read ({err.strerror}); the run folder is damaged",
            where=path,
            remedy="plan into a new folder",
        ) from None


def read_faults(run: Path) -> dict[str, Fault]:
    """The plan's faults by id."""
    faults = (fault_from(json.loads(line)) for line in _content(run / _FAULTS).splitlines())
    return {fault.id: fault for fault in faults}


def read_chunk(run: Path, chunk: Sequence[int], faults: Mapping[str, Fault]) -> tuple[Experiment, ...]:
    """The experiments of one chunk."""
    offset, length, _ = chunk
    with (run / _EXPERIMENTS).open("rb") as file:
        file.seek(offset)
        data = file.read(length)
    return tuple(experiment_from(json.loads(line), faults) for line in data.splitlines())


def read_all(run: Path) -> tuple[Experiment, ...]:
    """Every experiment, in the plan's order."""
    faults = read_faults(run)
    lines = _content(run / _EXPERIMENTS).splitlines()
    return tuple(experiment_from(json.loads(line), faults) for line in lines)


def ids(run: Path) -> Iterator[str]:
    """Every experiment's id, in the plan's order."""
    for line in _content(run / _EXPERIMENTS).splitlines():
        yield json.loads(line)["id"]


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
    """The experiment of a plan file's line; MutatorError for a field that this version does not know."""
    trigger = data["trigger"]
    values = {name: value for name, value in data.items() if name != "id"}
    read = {
        "fault": faults[data["fault"]],
        "method": Method(data["method"]),
        "trigger": _make(Trigger, trigger, hold=Hold(trigger["hold"])),
        "setting": tuple(data["setting"]),
    }
    return _make(Experiment, values, **read)


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
