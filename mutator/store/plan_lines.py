"""Read the lines of a plan: experiments, their ids, and faults.

No other module reads them. The MutatorError for a damaged line lacks its file and number, which callers add.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from mutator._common.bounded_reading import open_regular, read_bounded_lines
from mutator._common.confined_files import checked_name_not_path, checked_relative_path
from mutator._common.hashing import canonical_json
from mutator.errors import MutatorError
from mutator.limits import MOST_LIMIT_OR_TIME
from mutator.model import (
    AfterHazard,
    Anchor,
    AnchorKind,
    ConcreteScenario,
    Experiment,
    Fault,
    FaultLocation,
    Hold,
    Injection,
    Method,
    Trigger,
)

DAMAGED_PLAN_REMEDY = (
    "the plan is damaged: restore the file from a copy of the run folder, or plan into a new one"
)
_PARSE_ERRORS = (ValueError, LookupError, TypeError, AttributeError, RecursionError)

# A plan can have a million lines. Patterns read a line in canonical JSON in a third of the time that a JSON
# parser and `Experiment.id` take, and an id in a tenth. They only select text; `_parse_canonical` checks it.
_IDS_REGEX = rb'"fault":("[0-9a-f]{16}"),"id":"([0-9a-f]{16})",'
_IDS_PATTERN = re.compile(rb'\{(?:"after_hazard":"[a-z_]+",)?' + _IDS_REGEX)
_LINE_PATTERN = re.compile(
    rb"\{" + _IDS_REGEX + rb'"method":("[a-z_]+"),"scenario":("[^"\\]*"),"scenario_digest":("[^"\\]*"),'
    rb'"seed":(-?\d+),"setting":(\[[^\]]*\]),"trigger":(\{[^{}]*\})\}\n?'
)
_EXPERIMENT_ID_PATTERN = re.compile(r"[0-9a-f]{16}")
# the input of Experiment.id
_ID_FIELDS = ("fault", "scenario", "scenario_digest", "method", "trigger", "seed", "setting")

_T = TypeVar("_T")


def read_plan_lines(path: Path) -> Iterator[bytes]:
    try:
        with open_regular(path) as file:
            yield from read_bounded_lines(file, path)
    except OSError as err:
        raise MutatorError(
            f"cannot be read ({err.strerror})", where=path, remedy=DAMAGED_PLAN_REMEDY
        ) from None


def id_on_line(line: bytes) -> str:
    """Return the id that a line states, which is used in names of files. `parse_experiment` checks it."""
    if match := _IDS_PATTERN.match(line):
        return match[2].decode()
    return _parse_json_line(line, lambda data: _checked_id(data["id"]))


def values_hashed_into_id(line: bytes) -> dict[str, Any]:
    """Return the values on a line that determine its id, as JSON types. They are not compared with the id."""
    return _parse_json_line(line, lambda data: {name: data[name] for name in _ID_FIELDS})


def parse_experiment(line: bytes, faults: Mapping[str, Fault]) -> Experiment:
    """Return the experiment on a line; MutatorError if it does not match `id_on_line`, or for an unknown
    field.
    """
    return parse_canonical_experiment(line, faults) or _parse_json_line(
        line, lambda data: experiment_from_json(data | {"id": id_on_line(line)}, faults)
    )


def parse_fault(line: bytes) -> Fault:
    """Return the fault on a line; MutatorError for an unknown field."""
    return _parse_json_line(line, fault_from_json)


def _parse_json_line(line: bytes, convert: Callable[[dict[str, Any]], _T]) -> _T:
    try:
        return convert(json.loads(line))
    except _PARSE_ERRORS:
        raise MutatorError("a damaged line", remedy=DAMAGED_PLAN_REMEDY) from None


def _checked_id(name: object) -> str:
    if isinstance(name, str) and _EXPERIMENT_ID_PATTERN.fullmatch(name):
        return name
    raise ValueError(f"not an id: {name!a}")


def parse_canonical_experiment(line: bytes, faults: Mapping[str, Fault]) -> Experiment | None:
    """Return the experiment on a line in canonical JSON; None for any other, or if its id does not match."""
    if not (match := _LINE_PATTERN.fullmatch(line)):
        return None
    fault, name, method, scenario, scenario_digest, seed, setting, trigger = match.groups()
    # the input of Experiment.id
    hashed = b",".join((fault, scenario, scenario_digest, method, trigger, seed, setting))
    if sha256(b"[%b]" % hashed).hexdigest()[:16].encode() != name:
        return None
    try:
        experiment = Experiment(
            fault=faults[fault[1:-1].decode()],
            scenario=_parse_scenario(scenario),
            scenario_digest=_parse_scalar(scenario_digest),
            method=Method(_parse_scalar(method)),
            trigger=_parse_trigger(trigger),
            seed=_parse_scalar(seed),
            setting=_parse_setting(setting),
        )
    except (ValueError, LookupError, TypeError):
        return None
    vars(experiment)["id"] = name.decode()  # the value that the cached property would compute
    return experiment


def _parse_canonical(text: bytes) -> Any:
    """Parse canonical JSON; ValueError for any other, since an id is a digest of canonical JSON."""
    value = json.loads(text)
    if canonical_json(value).encode() != text:
        raise ValueError("not canonical")
    return value


# A plan has few scenarios, methods and seeds, but each random time is another trigger: the caches hold what
# repeats, and are bounded because a plan can have a million lines.
_parse_scalar = lru_cache(maxsize=1024)(_parse_canonical)


@lru_cache(maxsize=1024)
def _parse_scenario(text: bytes) -> str:
    return checked_name_not_path(_parse_canonical(text), "plan")


@lru_cache(maxsize=64)
def _parse_setting(text: bytes) -> tuple[str, ...]:
    return tuple(_parse_canonical(text))


@lru_cache(maxsize=16_384)
def _parse_trigger(text: bytes) -> Trigger:
    data = _parse_canonical(text)
    if data.keys() != _field_names(Trigger):
        raise ValueError("unknown fields")
    return Trigger(**{**data, "hold": Hold(data["hold"])})


def experiment_from_json(data: Mapping[str, Any], faults: Mapping[str, Fault]) -> Experiment:
    """Read the experiment on a line; MutatorError if its id does not match, or for an unknown field."""
    if data["fault"] not in faults:
        raise MutatorError(
            f"fault {data['fault']} is missing from plan/faults.jsonl, or was changed there",
            remedy=DAMAGED_PLAN_REMEDY,
        )
    checked_name_not_path(str(data["scenario"]), "plan")
    if "concrete" in data:
        raise ValueError("a scenario in an experiment")
    trigger = data["trigger"]
    values = {name: value for name, value in data.items() if name != "id"}
    converted = {
        "fault": faults[data["fault"]],
        "method": Method(data["method"]),
        "trigger": _object_from_json(Trigger, trigger, hold=Hold(trigger["hold"])),
        "setting": tuple(data["setting"]),
    }
    if "after_hazard" in data:
        converted["after_hazard"] = AfterHazard(data["after_hazard"])
    if "end_s" in data and not _is_end(data["end_s"], converted.get("after_hazard")):
        raise ValueError("an end that no run can have")
    experiment = _object_from_json(Experiment, values, **converted)
    if experiment.id != data["id"]:
        raise MutatorError(
            f"experiment {data['id']} has the content of {experiment.id}",
            expected="the content from which the id was made",
            remedy=DAMAGED_PLAN_REMEDY,
        )
    return experiment


def _is_end(end_s: object, after_hazard: object) -> bool:
    is_time = isinstance(end_s, float) and 0.0 < end_s <= MOST_LIMIT_OR_TIME
    return is_time and after_hazard is AfterHazard.STOP


def concrete_as_json(scenario: ConcreteScenario) -> dict[str, Any]:
    """Convert a concrete scenario to JSON types."""
    values = {name: getattr(scenario, name) for name in ("family", "label", "text")}
    return values | {"values": dict(scenario.values)}


def concrete_from_json(data: Mapping[str, Any]) -> ConcreteScenario:
    """Read a concrete scenario; ValueError, LookupError or TypeError if it is none."""
    texts = {name: data[name] for name in ("family", "label", "text")}
    numbers = data["values"].values()
    if not all(isinstance(text, str) for text in texts.values()) or any(
        type(value) not in (int, float, str) for value in numbers
    ):
        raise ValueError("not a concrete scenario")
    checked_relative_path(texts["family"], "plan", allow_folders=False)
    return ConcreteScenario(**texts, values=data["values"])


def with_stored_concrete(experiment: Experiment, data: Mapping[str, Any]) -> Experiment:
    """Return the experiment with the scenario under `concrete`, if any; ValueError for another scenario."""
    if "concrete" not in data:
        return experiment
    concrete = concrete_from_json(data["concrete"])
    if (concrete.name, concrete.digest) != (experiment.scenario, experiment.scenario_digest):
        raise ValueError(f"the scenario {concrete.name}")
    return replace(experiment, concrete=concrete)


def fault_from_json(data: Mapping[str, Any]) -> Fault:
    """Read the fault on a line of the plan; MutatorError for an unknown field."""
    return _object_from_json(
        Fault,
        data,
        injections=tuple(_injection_from_json(item) for item in data["injections"]),
        hold=Hold(data["hold"]) if data["hold"] else None,
        changes=tuple(data["changes"]),
    )


def _injection_from_json(data: Mapping[str, Any]) -> Injection:
    location, anchor = data["location"], data["location"]["anchor"]
    return _object_from_json(
        Injection,
        data,
        location=_object_from_json(
            FaultLocation, location, anchor=_object_from_json(Anchor, anchor, kind=AnchorKind(anchor["kind"]))
        ),
        params=tuple((name, value) for name, value in data["params"]),
    )


def _object_from_json(kind: type[_T], data: Mapping[str, Any], /, **converted: Any) -> _T:
    """Create an object from plain data and `converted` values. Missing fields get defaults."""
    if unknown := sorted(data.keys() - _field_names(kind)):  # type: ignore[arg-type]
        raise MutatorError(
            f"{kind.__name__.lower()} has '{unknown[0]}', which this version of mutator does not know",
            expected="a plan that this version or an older one wrote",
            remedy="update mutator, or plan into a new folder",
        )
    return kind(**{**data, **converted})


@lru_cache(maxsize=16)
def _field_names(kind: type[Any]) -> frozenset[str]:
    return frozenset(field.name for field in fields(kind))
