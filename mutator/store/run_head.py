"""`run.json`, the head of a run folder: what was planned, for which target, and who worked on it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from mutator._common.confined_files import check_library_name, check_name
from mutator._common.files import json_bytes, read_json
from mutator._common.folder_search import RUN_HEAD
from mutator._common.hashing import added, plain
from mutator._common.typed_json import from_plain
from mutator.errors import Misfit, MutatorError
from mutator.model import Limits
from mutator.store.plan_choices import Choices
from mutator.store.plan_file import Chunk
from mutator.store.work_stretches import Stretch
from mutator.targets.target_facts import TargetFacts

SCHEMA = "run/3"
HEAD, CAMPAIGN = RUN_HEAD, "campaign.yaml"
REMEDY = "the run folder is damaged: restore the file from a copy of it"
Names = tuple[str, ...]
StoredGolden = tuple[str, Names] | tuple[str, Names, int]  # scenario, changes; seed, if the plan has several


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What planned the run: the version of mutator."""

    mutator: str


@dataclass(frozen=True, kw_only=True)
class PlanFacts:
    """What run.json says about the plan."""

    schema: str
    plan: str
    campaign: str
    campaign_digest: str
    study: str | None
    target: str
    seed: int
    seeds: tuple[int, int] | None = added(None)  # the first and the last, if the plan has several
    reading: str
    operators: Names = added(())
    choices: Choices
    experiments: int
    runs: int
    limits: Limits


@dataclass(frozen=True, kw_only=True)
class RunHead(TargetFacts, PlanFacts):
    """The content of a run.json, key by key: docs/reference/run-folder.md says what each means. The keys of
    `PlanFacts`, the last base, come first.
    """

    goldens: tuple[StoredGolden, ...]
    canary: Mapping[str, Any]
    canary_hazard: str
    sources: Mapping[str, str]
    provenance: Provenance
    stretches: tuple[Stretch, ...]
    chunks: tuple[Chunk, ...]
    later: Mapping[str, Any] = field(default_factory=dict)  # keys that a later version adds: kept, and sealed

    def content(self) -> dict[str, Any]:
        """Return the keys and their values in JSON types, in the order of the file."""
        found: dict[str, Any] = plain(self)
        return {**{name: found[name] for name in _KEYS if name in found}, **found["later"]}

    def differences(self, other: "RunHead") -> Iterator[tuple[str, Any, Any]]:
        """Yield the keys whose values differ, with both values."""
        for name in _KEYS:
            mine, its = getattr(self, name), getattr(other, name)
            if mine != its:
                yield name, mine, its

    def as_json(self) -> bytes:
        return json_bytes(self.content())


_KEYS = tuple(one.name for one in fields(RunHead) if one.name != "later")


def read_head(run: Path) -> RunHead:
    """Read the head of a run folder; MutatorError if it is damaged or has another schema."""
    path = run / HEAD
    try:
        head = from_plain(RunHead, _sorted(read_json(path, SCHEMA)))
    except Misfit as err:
        raise _damaged(path, err) from None
    for name in head.golden_files:
        check_name(name, path)
    for name in (head.target, *(golden[0] for golden in head.goldens)):
        check_library_name(name, path)
    return head


def _sorted(content: dict[str, Any]) -> dict[str, Any]:
    """Put the keys that this version does not know under `later`."""
    known = {name: value for name, value in content.items() if name in _KEYS}
    return known | {"later": {name: value for name, value in content.items() if name not in known}}


def _damaged(path: Path, misfit: Misfit) -> MutatorError:
    if not misfit.path:
        return MutatorError(misfit.got, where=path, expected="a complete run.json", remedy=REMEDY)
    key, *below = misfit.path
    place = "".join(f"[{one!a}]" for one in below)
    got = f"damaged at '{key}' ({place + ': ' if place else ''}{misfit.got})"
    return MutatorError(got, where=path, expected=misfit.expected, remedy=REMEDY)
