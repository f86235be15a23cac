"""Likely reasons why a target is not deterministic: lines noted in a run or found in the source."""

from collections.abc import Mapping
from typing import Any

from mutator.checks import set_iteration_order
from mutator.checks.check_findings import FindingPlace
from mutator.engines.in_target.nondeterminism_watch import CLOCK, DRAW, HASH, PROCESS, THREAD
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches_any_glob

_MOST_LISTED_PLACES = 5  # the first causes hide the later ones, so a long list helps nobody
_REMEDY_BY_KIND = {
    CLOCK: "count time in steps: `step * dt`",
    DRAW: "draw from `numpy.random.default_rng(seed)` with the run's seed",
    THREAD: "do the work within the step",
    PROCESS: "do not depend on addresses or process ids",
    HASH: "do not depend on hashes; use `sorted(...)` where a set's order matters",
}
_UNKNOWN_CAUSE_REMEDY = (
    "no line of the target read a clock, drew without a seed or started a thread; "
    "check the target's inputs (files, the network) and the state of its libraries"
)


def likely_places_and_remedies(
    manifest: TargetManifest, watch_report: Mapping[str, Any], *, depends_on_hash_seed: bool
) -> tuple[list[FindingPlace], str]:
    """Return the most suspicious lines, likeliest first, and the remedies.

    `depends_on_hash_seed` means that runs agree with equal PYTHONHASHSEED and differ otherwise, which points
    to set order or hashes. `watch_report` has the notes of a watched run.
    """
    notes = watch_report.get("noted", [])
    hashes = [note for note in notes if note["kind"] == HASH]
    others = [note for note in notes if note["kind"] != HASH]
    ordered = [(HASH, place) for place in set_order_places(manifest)]
    by_hashes = [*((HASH, place_of_note(note)) for note in hashes), *ordered]
    by_others = [(note["kind"], place_of_note(note)) for note in others]
    suspects = by_hashes if depends_on_hash_seed else (by_others or by_hashes)
    remedies = dict.fromkeys(_REMEDY_BY_KIND[kind] for kind, _ in suspects[:_MOST_LISTED_PLACES])
    unknown = _REMEDY_BY_KIND[HASH] if depends_on_hash_seed else _UNKNOWN_CAUSE_REMEDY
    return [place for _, place in suspects[:_MOST_LISTED_PLACES]], "; ".join(remedies) or unknown


def set_order_places(manifest: TargetManifest) -> list[FindingPlace]:
    """Lines of target files that depend on the order of a set. Files in which faults are forbidden come
    last.
    """
    places = []
    for path in sorted(
        manifest.tree.files, key=lambda path: (matches_any_glob(path, manifest.forbidden_globs), path)
    ):
        if path.endswith(".py"):
            for use in set_iteration_order.list_set_order_uses(manifest.tree.files[path]):
                what = f"in {use.function}: uses the order of a set, {use.set_source}"
                places.append(FindingPlace(file=path, line=use.line, what=what))
    return places


def places_of_kind(watch_report: Mapping[str, Any], kind: str) -> list[FindingPlace]:
    return [place_of_note(note) for note in watch_report.get("noted", []) if note["kind"] == kind]


def place_of_note(note: Mapping[str, Any]) -> FindingPlace:
    via = f" by {note['via']}" if note["via"] else ""
    what = f"in {note['function']}{via}: {note['what']}"
    return FindingPlace(file=note["file"], line=note["line"], what=what)
