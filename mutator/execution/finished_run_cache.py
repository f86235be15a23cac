"""Cache the outcome of a finished run, so that later sessions need not read its records."""

from collections import Counter
from dataclasses import asdict, dataclass

from mutator.audit.seal import Seals
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store import integrity, verified_runs_cache
from mutator.store.run_folder import RunFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The outcome that every later session of a finished run reports."""

    outcomes: Counter[str]
    proof: EquivalenceResult | None
    seals: Seals


def keep_end(folder: RunFolder, ended: Ended) -> None:
    if key := integrity.verified_content_key(folder.path):
        proof = ended.proof and {"sampled": ended.proof.sampled, "same": ended.proof.same}
        told = {"outcomes": dict(ended.outcomes), "proof": proof, "seals": asdict(ended.seals)}
        verified_runs_cache.remember_facts(key, ended=told)


def ended_before(folder: RunFolder) -> Ended | None:
    """Return the stored outcome of a finished run whose verified bytes have not changed; else None."""
    if not folder.is_finished or not (key := integrity.verified_content_key(folder.path)):
        return None
    known = verified_runs_cache.recall_facts(key)
    if not known.get("verified") or "ended" not in known:
        return None
    told = known["ended"]
    proof = told["proof"]
    return Ended(
        outcomes=Counter(told["outcomes"]),
        proof=EquivalenceResult(sampled=proof["sampled"], same=proof["same"]) if proof else None,
        seals=Seals(**told["seals"]),
    )
