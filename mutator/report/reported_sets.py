"""Sets of defences as a report shows them: their pairs, the page that replays these, and what the list of
experiments says about them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from mutator.comparison.defended_pairs import PAIR_OUTCOME_MEANINGS, DefendedPair
from mutator.comparison.defended_sets import DefendedSet, load_defended_sets
from mutator.comparison.run_comparison_and_gates import Comparison, compare_loaded_runs
from mutator.store.allowed_contents import DEFENDED_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.targets.overhead_view_json import scene_as_json

ALL_SETS_COLUMN = "with_defences"  # of the list: each set, and what became of the experiment


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedSet:
    """A set of defences, and the comparison of its run with the undefended one, drive by drive."""

    defended: DefendedSet
    comparison: Comparison

    @property
    def page_name(self) -> str:
        """The page of the comparison, in the report's folder."""
        return f"{DEFENDED_FOLDER}/{self.defended.name}/index.html"

    @property
    def column(self) -> str:
        """The set's column in the list of experiments. Searches name columns, so it is one word."""
        return f"with_{self.defended.name.replace('+', '_and_')}"


def load_reported_sets(folder: RunFolder, manifest: TargetManifest | None) -> tuple[ReportedSet, ...]:
    """Return the sets of a run that have results; MutatorError as for `load_defended_sets`."""
    scene = scene_as_json(manifest) if manifest else None
    return tuple(
        ReportedSet(
            defended=defended,
            comparison=compare_loaded_runs(defended.undefended, defended.defended, scenes=(scene, scene)),
        )
        for defended in load_defended_sets(folder)
    )


def list_columns(sets: Sequence[ReportedSet], ids: Sequence[str]) -> dict[str, list[str]]:
    """Return the columns of the list of experiments on the page: one for each set, and one with all sets."""
    pairs_by_set = [_pair_by_id(of_set) for of_set in sets]
    columns = {
        of_set.column: [_what_became(pairs.get(name)) for name in ids]
        for of_set, pairs in zip(sets, pairs_by_set, strict=True)
    }
    rows = zip(*columns.values(), strict=True)
    together = [
        ";".join(f"{of_set.defended.name}: {text}" for of_set, text in zip(sets, texts, strict=True))
        for texts in rows
    ]
    return {ALL_SETS_COLUMN: together, **columns} if sets else {}


def page_facts(sets: Sequence[ReportedSet]) -> dict[str, Any]:
    """Return what the page's scripts know of the sets: names, columns, pages, and what the outcomes mean."""
    return {
        "sets": [{"name": s.defended.name, "column": s.column, "page": quote(s.page_name)} for s in sets],
        "outcomes": {outcome.words: meaning for outcome, meaning in PAIR_OUTCOME_MEANINGS.items()},
    }


def page_details(sets: Iterable[ReportedSet], ids: Sequence[str]) -> list[dict[str, Any]]:
    """Return, for each set, what acted in each listed experiment, and the rows of those whose pair has a
    replay on the set's page.
    """
    details = []
    for of_set in sets:
        pairs, changed = _pair_by_id(of_set), {pair.b.id for pair in of_set.comparison.changed_pairs}
        acted = [_what_acted(pairs.get(name)) for name in ids]
        words = sorted({*acted})
        code = {word: number for number, word in enumerate(words)}
        details.append(
            {
                "words": words,
                "codes": [code[text] for text in acted],
                "changed": [row for row, name in enumerate(ids) if name in changed],
            }
        )
    return details


def _pair_by_id(of_set: ReportedSet) -> dict[str, DefendedPair]:
    return {pair.undefended.experiment_id: pair for pair in of_set.defended.pairs}


def _what_became(pair: DefendedPair | None) -> str:
    return pair.what_became if pair else "no result yet"


def _what_acted(pair: DefendedPair | None) -> str:
    if pair is None or not pair.facts.acted:
        return ""
    names, first = ", ".join(pair.facts.acted), pair.facts.first_acted_s
    return names if first is None else f"{names}, first at {first:.2f} s"
