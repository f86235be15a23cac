"""`run.json`, the head of a run folder: what was planned, for which target, and who worked on it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from mutator._common.confined_files import checked_name_not_path, checked_relative_path
from mutator._common.files import json_bytes, read_json
from mutator._common.hashing import added_field, as_json_types
from mutator._common.library_and_run_folder_search import RUN_HEAD_FILE
from mutator._common.typed_json import typed_value_from_json
from mutator.defences.defence_facts import DefenceFacts
from mutator.errors import MutatorError, TypeMisfit
from mutator.families.family_facts import FamilyFacts
from mutator.limits import Limits
from mutator.model import GoldenClass
from mutator.store.golden_runs import StoredGolden
from mutator.store.plan_choices import Choices
from mutator.store.plan_file import Chunk
from mutator.store.session_environments import SessionEnvironment
from mutator.targets.stored_phrases import Phrases
from mutator.targets.stored_target_facts import TargetFacts

RUN_SCHEMA = "run/3"
HEAD, CAMPAIGN_FILE = RUN_HEAD_FILE, "campaign.yaml"
DAMAGED_RUN_REMEDY = "the run folder is damaged: restore the file from a copy of it"
NameTuple = tuple[str, ...]
Sha256 = str
FirstAndLastSeed = tuple[int, int]
OperatorSelectionText = str  # number of mutants of a selection of operators, and what was left out


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What planned the run: the version of mutator."""

    mutator: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchFacts:
    """What tells a bench's run folder from a campaign's. `origin`: the digest of the plan before its first
    experiment, with which files of lines begin, because the plan's digest changes as the plan grows.
    """

    origin: Sha256


@dataclass(frozen=True, kw_only=True)
class PlanFacts:
    """What run.json says about the plan."""

    schema: str
    plan: Sha256
    campaign: str
    campaign_digest: Sha256
    study: str | None
    target: str
    seed: int
    seeds: FirstAndLastSeed | None = added_field(None)  # if the plan has several
    reading: str
    operators: tuple[OperatorSelectionText, ...] = added_field(())
    choices: Choices
    experiments: int
    runs: int
    limits: Limits
    # scenarios that run although their golden run has a hazard
    include: GoldenClass | None = added_field(None)
    bench: BenchFacts | None = added_field(None)


@dataclass(frozen=True, kw_only=True)
class RunHead(TargetFacts, PlanFacts):
    """The content of a run.json, key by key: docs/reference/run-folder.md says what each means. The keys of
    `PlanFacts`, the last base, come first.
    """

    phrases: Phrases = added_field(Phrases())
    goldens: tuple[StoredGolden, ...]
    scenarios: Sha256 | None = added_field(None)  # of plan/scenarios.jsonl, if families gave any scenario
    families: tuple[FamilyFacts, ...] = added_field(())  # those whose scenarios are planned
    defences: tuple[DefenceFacts, ...] = added_field(())  # in the tree, in the campaign's order
    canary: Mapping[str, Any] | None
    canary_hazard: str | None
    sources: Mapping[str, Sha256]
    provenance: Provenance
    stretches: tuple[SessionEnvironment, ...]
    chunks: tuple[Chunk, ...]
    keys_of_later_versions: Mapping[str, Any] = field(
        default_factory=dict
    )  # keys that a later version adds: kept, and sealed

    @property
    def plan_of_lines(self) -> Sha256:
        """The digest of the plan with which the files of lines begin."""
        return self.bench.origin if self.bench else self.plan

    def as_json(self) -> dict[str, Any]:
        """Return the keys and their values in JSON types, in the order of the file."""
        values: dict[str, Any] = as_json_types(self)
        return {
            **{name: values[name] for name in _HEAD_KEYS if name in values},
            **values["keys_of_later_versions"],
        }

    def differences(self, other: "RunHead") -> Iterator[tuple[str, Any, Any]]:
        """Yield the keys whose values differ, with both values."""
        for name in _HEAD_KEYS:
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                yield name, mine, its

    def file_bytes(self) -> bytes:
        return json_bytes(self.as_json())


_HEAD_KEYS = tuple(
    head_field.name for head_field in fields(RunHead) if head_field.name != "keys_of_later_versions"
)


def load_head(run: Path) -> RunHead:
    """Read the head of a run folder; MutatorError if it is damaged or has another schema."""
    path = run / HEAD
    try:
        head = typed_value_from_json(RunHead, _with_unknown_keys_apart(read_json(path, RUN_SCHEMA)))
    except TypeMisfit as err:
        raise _damage_error(path, err) from None
    for name in head.golden_files:
        checked_relative_path(name, path)
    for name in (head.target, *(golden[0] for golden in head.goldens)):
        checked_name_not_path(name, path)
    for defence in head.defences:
        if not defence.name.isidentifier():
            raise MutatorError(
                f"defence {defence.name!a}",
                where=path,
                expected="a name of letters, digits and _",
                remedy=DAMAGED_RUN_REMEDY,
            )
    return head


def _with_unknown_keys_apart(content: dict[str, Any]) -> dict[str, Any]:
    """Put the keys that this version does not know under `keys_of_later_versions`."""
    known_keys = {name: value for name, value in content.items() if name in _HEAD_KEYS}
    return known_keys | {
        "keys_of_later_versions": {name: value for name, value in content.items() if name not in known_keys}
    }


def _damage_error(path: Path, misfit: TypeMisfit) -> MutatorError:
    if not misfit.path:
        return MutatorError(misfit.got, where=path, expected="a complete run.json", remedy=DAMAGED_RUN_REMEDY)
    key, *below = misfit.path
    place_below = "".join(f"[{key_below!a}]" for key_below in below)
    got = f"damaged at '{key}' ({place_below + ': ' if place_below else ''}{misfit.got})"
    return MutatorError(got, where=path, expected=misfit.expected, remedy=DAMAGED_RUN_REMEDY)
