"""Plans in parts, one per seed, so that counting and hashing need only one part at a time."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from hashlib import sha256

from mutator._common.hashing import as_json_types, canonical_json
from mutator.campaigns.campaign_files import Campaign
from mutator.model import Experiment, Fault
from mutator.store.run_folder import GoldenRun

# The start of every plan digest. Publications cite digests, so this text must never change.
_DIGEST_PREFIX = "run/1"

Group = tuple[str, str, str]  # module, fault type, method


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Experiments in run order, the lengths of their chunks, and the number of runs; experiments can share
    a run.
    """

    experiments: Sequence[Experiment]
    chunks: Sequence[int]
    runs: int


@dataclass(slots=True, kw_only=True)
class Tally:
    """The totals of the plan parts added so far."""

    canary: Experiment
    several_seeds: bool  # each seed has its own golden runs
    experiments: int = 0
    runs: int = 0
    chunks: list[int] = field(default_factory=list)
    groups: Counter[Group] = field(default_factory=Counter)
    goldens: dict[GoldenRun, None] = field(default_factory=dict)
    variants: dict[str, Fault] = field(default_factory=dict)  # one fault per variant

    def add(self, part: Part) -> None:
        self.experiments += len(part.experiments)
        self.runs += part.runs
        self.chunks += part.chunks
        for one in part.experiments:
            fault = one.fault
            self.groups[fault.module, fault.fault_type, one.method.value] += 1
            self.goldens.setdefault(GoldenRun.for_experiment(one, several_seeds=self.several_seeds))
            self.variants[fault.spec] = fault

    def needed(self) -> tuple[GoldenRun, ...]:
        own = GoldenRun.for_experiment(self.canary, several_seeds=self.several_seeds)
        return tuple(dict.fromkeys((*self.goldens, own)))


class PlanDigest:
    """The digest of the ids and chunks of the experiments, the canary's id, and the campaign."""

    def __init__(self) -> None:
        self._hash = sha256(f"[{canonical_json(_DIGEST_PREFIX)},[".encode())
        self._joint = ""

    def add(self, ids: Sequence[str]) -> None:
        if ids:
            self._hash.update((self._joint + ",".join(f'"{name}"' for name in ids)).encode())
            self._joint = ","

    def end(self, chunks: Sequence[int], canary: str, campaign: Campaign) -> str:
        rest = [chunks, canary, as_json_types(campaign.canary), as_json_types(campaign.limits)]
        self._hash.update(f"],{canonical_json(rest)[1:]}".encode())
        return self._hash.hexdigest()


def plan_digest(ids: Sequence[str], chunks: Sequence[int], canary: str, campaign: Campaign) -> str:
    made = PlanDigest()
    made.add(ids)
    return made.end(chunks, canary, campaign)
