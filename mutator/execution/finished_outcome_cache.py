"""Cache the outcome of a finished run, so that later sessions need not read its records."""

from collections import Counter
from dataclasses import asdict, dataclass

from mutator.audit.run_digests_and_seal import Seals
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store import integrity, verified_runs_cache
from mutator.store.run_folder import RunFolder


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRunOutcome:
    """The outcome that every later session of a finished run reports."""

    outcomes: Counter[str]
    proof: EquivalenceResult | None
    seals: Seals


def remember_finished_run(folder: RunFolder, outcome: FinishedRunOutcome) -> None:
    if key := integrity.verified_cache_key(folder.path):
        proof = outcome.proof and {
            name: getattr(outcome.proof, name)
            for name in ("sampled", "same", "chosen", "same_chosen", "note")
        }
        outcome_as_json = {"outcomes": dict(outcome.outcomes), "proof": proof, "seals": asdict(outcome.seals)}
        verified_runs_cache.remember_facts(key, ended=outcome_as_json)


def find_finished_run(folder: RunFolder) -> FinishedRunOutcome | None:
    """Return the stored outcome of a finished run whose verified bytes have not changed; else None."""
    if not folder.is_finished or not (key := integrity.verified_cache_key(folder.path)):
        return None
    remembered = verified_runs_cache.recall_facts(key)
    if not remembered.get("verified") or "ended" not in remembered:
        return None
    outcome_as_json = remembered["ended"]
    proof = outcome_as_json["proof"]
    return FinishedRunOutcome(
        outcomes=Counter(outcome_as_json["outcomes"]),
        proof=EquivalenceResult(**proof) if proof else None,
        seals=Seals(**outcome_as_json["seals"]),
    )
