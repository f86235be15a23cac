"""Summarizes how the experiments of a run were executed, and the result of their equivalence check."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator._common.table_rendering import TextTable
from mutator.engines.engine_jobs import RunMode
from mutator.errors import CheckFailed
from mutator.model import Record
from mutator.preflight import equivalence_check
from mutator.store.records import PROOF_FOLDER
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from pandas import DataFrame

MOST_LISTED_REASONS = (
    20  # maximum number of listed reasons for using the reference engine, most frequent first
)
_MODE_DESCRIPTIONS = {
    RunMode.FORK: "a fork of the golden run, just before the fault is first active",
    RunMode.GOLDEN_REUSED: "no run: the trigger never holds, so the golden run's result is used",
    RunMode.REUSED: "no run: an earlier run had the same experiment, so its result was copied",
    RunMode.UNAFFECTED: "no run: nothing that an earlier run executed has changed, so its result stands",
    RunMode.WARM: "a fork of the loaded program, from the start of the run",
    RunMode.REFERENCE: "a fresh interpreter (reference engine)",
    None: "no run: there is no mutant",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineSummary:
    """How many experiments each mode executed, and the equivalence check as a sentence and in brief."""

    table: TextTable
    equivalence_text: str
    equivalence_in_brief: str
    has_failed_equivalence: bool  # an experiment had a different result on the reference engine


def summarize_engines(
    folder: RunFolder, records: Mapping[str, Record], timings: "DataFrame"
) -> EngineSummary | None:
    """Summarize a run's `timings` (as in `ExperimentFacts`) and `proof/`; None if it has neither."""
    counts_by_mode = _count_modes(timings)
    if not counts_by_mode and not (folder.path / PROOF_FOLDER).is_dir():
        return None
    sentence, state, failed = _describe_equivalence(folder, records)
    table = TextTable(heads=("how", "experiments"), rows=list(_table_rows(counts_by_mode)))
    return EngineSummary(
        table=table, equivalence_text=sentence, equivalence_in_brief=state, has_failed_equivalence=failed
    )


def _count_modes(timings: "DataFrame") -> Counter[tuple[str | None, str]]:
    engines = (None if name is None or name != name else str(name) for name in timings["engine"])
    return Counter(zip(engines, map(str, timings["why"]), strict=True))


def _table_rows(counts_by_mode: Counter[tuple[str | None, str]]) -> Iterator[list[str]]:
    for mode, description in _MODE_DESCRIPTIONS.items():
        reasons = {reason: count for (name, reason), count in counts_by_mode.items() if name == mode}
        if count := reasons.pop("", 0):
            yield [description, str(count)]
        by_count = sorted(reasons.items(), key=lambda item: (-item[1], item[0]))
        for why, count in by_count[:MOST_LISTED_REASONS]:
            yield [f"{description}, because the run cannot be forked: {why}", str(count)]
        if rest := sum(count for _, count in by_count[MOST_LISTED_REASONS:]):
            yield [f"{description}, for other reasons (see timings/)", str(rest)]


def _describe_equivalence(folder: RunFolder, records: Mapping[str, Record]) -> tuple[str, str, bool]:
    try:
        check = equivalence_check.compare_sample(folder, records)
    except CheckFailed as err:
        text = f"The equivalence check failed. Do not trust these results: {err.got}."
        return text, f"FAILED: {err.got}", True
    if check is None:
        text = "All experiments ran on the reference engine, so no equivalence check is needed."
        return text, "none needed", False
    same_of_all = f"{check.same + check.same_chosen} of {check.sampled + check.chosen}"
    if not check.is_complete:
        judged = f"{same_of_all} judged, none differs"
        return f"The equivalence check is not finished: {check}.", f"not finished: {judged}", False
    note = f" {check.note[:1].upper()}{check.note[1:]}." if check.note else ""
    text = (
        "Equivalence check: a sample was rerun from the start and compared byte for byte: "
        f"{check.without_note}.{note}"
    )
    return text, f"{same_of_all} same", False
