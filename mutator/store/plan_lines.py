"""Read experiments and their ids from plan lines, without parsing a whole line as JSON."""

import json
import re
from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from hashlib import sha256
from typing import Any

from mutator.model import Experiment, Fault, Hold, Method, Trigger

_LINE = re.compile(
    rb'\{"fault":("[0-9a-f]{16}"),"id":"([0-9a-f]{16})","method":("[a-z_]+"),"scenario":("[^"\\]*"),'
    rb'"scenario_digest":("[^"\\]*"),"seed":(\d+),"setting":(\[[^\]]*\]),"trigger":(\{[^{}]*\})\}\n?'
)
_FIELDS = {field.name for field in fields(Trigger)}


def experiment_as_written(line: bytes, faults: Mapping[str, Fault]) -> Experiment | None:
    """Read the experiment on a line in canonical JSON.

    Return None for other lines, and if the id does not match; `plan_file` then parses the line.
    """
    if not (found := _LINE.fullmatch(line)):
        return None
    fault, name, method, scenario, scenario_digest, seed, setting, trigger = found.groups()
    # the input of Experiment.id
    hashed = b",".join((fault, scenario, scenario_digest, method, trigger, seed, setting))
    if sha256(b"[%b]" % hashed).hexdigest()[:16].encode() != name:
        return None
    try:
        experiment = Experiment(
            fault=faults[fault[1:-1].decode()],
            scenario=_read(scenario),
            scenario_digest=_read(scenario_digest),
            method=Method(_read(method)),
            trigger=_trigger(trigger),
            seed=int(seed),
            setting=_setting(setting),
        )
    except (ValueError, LookupError, TypeError):
        return None
    vars(experiment)["id"] = name.decode()  # the value that the cached property would compute
    return experiment


@lru_cache(maxsize=1024)
def _read(text: bytes) -> Any:
    return json.loads(text)


@lru_cache(maxsize=64)
def _setting(text: bytes) -> tuple[str, ...]:
    return tuple(json.loads(text))


@lru_cache(maxsize=16_384)
def _trigger(text: bytes) -> Trigger:
    data = json.loads(text)
    if data.keys() != _FIELDS:
        raise ValueError("unknown fields")
    return Trigger(**{**data, "hold": Hold(data["hold"])})
