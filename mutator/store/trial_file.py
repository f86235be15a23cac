"""`trial.json`: what `try` ran, in the folder of its output, with the digests of its sources."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import read_below, write_below
from mutator._common.files import json_bytes, parse_json_object
from mutator._common.hashing import as_json_types
from mutator._common.typed_json import typed_value_from_json
from mutator.errors import MutatorError
from mutator.model import Experiment, Record
from mutator.store import plan_file
from mutator.store.plan_lines import (
    concrete_as_json,
    experiment_from_json,
    fault_from_json,
    with_stored_concrete,
)
from mutator.store.records import record_as_json

TRIAL_SCHEMA, TRIAL_FILE = "trial/1", "trial.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTrial:
    target: str
    sources: Mapping[str, str]  # digests by name, as in run.json
    experiment: Experiment
    record: Record

    def write(self, folder: Path) -> None:
        fault = as_json_types(self.experiment.fault)
        content = {
            "schema": TRIAL_SCHEMA,
            "target": self.target,
            "sources": dict(self.sources),
            "experiment": plan_file.experiment_as_json(self.experiment) | {"fault": fault},
            "record": as_json_types(record_as_json(self.record)),
        }
        if self.experiment.concrete is not None:
            content["concrete"] = concrete_as_json(self.experiment.concrete)
        write_below(folder, TRIAL_FILE, json_bytes(content))

    @classmethod
    def read(cls, folder: Path) -> "StoredTrial":
        """Read the file in a folder; MutatorError if it is missing or damaged."""
        path = folder / TRIAL_FILE
        try:
            stored = parse_json_object(read_below(folder, TRIAL_FILE), path, TRIAL_SCHEMA)
            fault = fault_from_json(stored["experiment"]["fault"])
            experiment = experiment_from_json(stored["experiment"] | {"fault": fault.id}, {fault.id: fault})
            return cls(
                target=str(stored["target"]),
                sources={str(name): str(digest) for name, digest in stored["sources"].items()},
                experiment=with_stored_concrete(experiment, stored),
                record=typed_value_from_json(Record, stored["record"]),
            )
        except OSError:
            raise MutatorError(
                "no trial here",
                where=path,
                expected="the output of `mutator try --out`",
                remedy="try the fault again",
            ) from None
        except (ValueError, LookupError, TypeError, AttributeError):
            raise MutatorError("a damaged trial", where=path, remedy="try the fault again") from None
