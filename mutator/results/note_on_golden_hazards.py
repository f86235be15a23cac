"""What results begin with if golden runs have a hazard: which experiments were left out, or how they are
judged.
"""

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING

from mutator._common.message_text import counted
from mutator.model import GoldenClass, Outcome, Record, Status
from mutator.store.checks_file import describe_golden_hazards
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

_MOST_LISTED = 5  # reasons, or golden runs


def golden_hazards_note(folder: RunFolder, results: "pd.DataFrame") -> str:
    """Return what results and report say of golden runs that have a hazard; '' if none has. `results` has a
    row for each experiment.
    """
    if folder.head.include is None:
        details = results["detail"][results["status"] == Status.LEFT_OUT.value]
        return left_out_note(Counter(details), len(results))
    hazards_by_key = folder.golden_hazards
    if not hazards_by_key:
        return ""
    listed = [
        f"{key} ({describe_golden_hazards(hazards)})"
        for key, hazards in sorted(hazards_by_key.items())[:_MOST_LISTED]
    ]
    more = len(hazards_by_key) - len(listed)
    names = ", ".join(listed) + (f" and {more:,} more" if more else "")
    not_judged = int((results["outcome"] == Outcome.NOT_JUDGED.value).sum())
    late = f"; {not_judged:,} were not active before it, and are not judged" if not_judged else ""
    is_plural = len(hazards_by_key) > 1
    return (
        f"The golden {'runs' if is_plural else 'run'} of {names} {'have' if is_plural else 'has'} a hazard "
        f"without any fault. Faults there are judged by what they add to it{late}."
    )


def left_out_note_of_records(
    folder: RunFolder, records: Mapping[str, Record], count_by_ending: Mapping[str, int]
) -> str:
    """Like `left_out_note`, from the records of a run, which are read only if any was left out."""
    if not count_by_ending.get(Status.LEFT_OUT.value):
        return ""
    ids = [ending.experiment_id for ending in endings_of(records) if ending.status == Status.LEFT_OUT.value]
    return left_out_note(Counter(records[name].detail for name in ids), folder.planned_experiment_count)


def left_out_note(count_by_reason: Mapping[str, int], planned: int) -> str:
    """Return which experiments of a run were left out, and why; '' if none was."""
    left_out = sum(count_by_reason.values())
    if not left_out:
        return ""
    by_count = sorted(count_by_reason.items(), key=lambda item: (-item[1], item[0]))
    reasons = [f"{reason} ({number:,})" for reason, number in by_count[:_MOST_LISTED]]
    if more := sum(number for _, number in by_count[_MOST_LISTED:]):
        reasons.append(f"others likewise ({more:,})")
    all_out = "Every experiment is left out, so that nothing was tried: " if left_out == planned else ""
    count = "" if all_out else f"{counted(left_out, 'experiment')} of {planned:,} left out: "
    remedy = f"`include: {GoldenClass.HAZARD_WITHOUT_FAULT}` in the campaign runs them"
    return f"{all_out}{count}{'; '.join(reasons)}. {remedy}."
