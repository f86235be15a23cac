"""Likely reasons why a target is not deterministic: lines noted in a run or found in the source."""

from collections.abc import Mapping
from typing import Any

from mutator.checks import set_iteration_order
from mutator.checks.findings import Place
from mutator.engines.in_target.nondeterminism_watch import CLOCK, DRAW, HASH, PROCESS, THREAD
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches

_MOST = 5
_REMEDIES = {
    CLOCK: "count time in steps: `step * dt`",
    DRAW: "draw from `numpy.random.default_rng(seed)` with the run's seed",
    THREAD: "do the work within the step",
    PROCESS: "do not depend on addresses or process ids",
    HASH: "do not depend on hashes; use `sorted(...)` where a set's order matters",
}
_UNKNOWN = (
    "no line of the target read a clock, drew without a seed or started a thread; "
    "check the target's inputs (files, the network) and the state of its libraries"
)


def likely(manifest: TargetManifest, watched: Mapping[str, Any], *, by_hash: bool) -> tuple[list[Place], str]:
    """Return the most suspicious lines, likeliest first, and the remedies.

    `by_hash` means that runs agree with equal PYTHONHASHSEED and differ otherwise, which points to set order
    or hashes. `watched` has the notes of a watched run.
    """
    noted = watched.get("noted", [])
    hashes = [one for one in noted if one["kind"] == HASH]
    others = [one for one in noted if one["kind"] != HASH]
    ordered = [(HASH, place) for place in sets(manifest)]
    by_hashes = [*((HASH, place_of(one)) for one in hashes), *ordered]
    by_others = [(one["kind"], place_of(one)) for one in others]
    found = by_hashes if by_hash else (by_others or by_hashes)
    remedies = dict.fromkeys(_REMEDIES[kind] for kind, _ in found[:_MOST])
    unknown = _REMEDIES[HASH] if by_hash else _UNKNOWN
    return [place for _, place in found[:_MOST]], "; ".join(remedies) or unknown


def sets(manifest: TargetManifest) -> list[Place]:
    """Lines of target files that depend on the order of a set. Files in which faults are forbidden come
    last.
    """
    found = []
    for path in sorted(manifest.tree.files, key=lambda path: (matches(path, manifest.forbid), path)):
        if path.endswith(".py"):
            for one in set_iteration_order.places(manifest.tree.files[path]):
                what = f"in {one.function}: uses the order of a set, {one.what}"
                found.append(Place(file=path, line=one.line, what=what))
    return found


def of_kind(watched: Mapping[str, Any], kind: str) -> list[Place]:
    return [place_of(one) for one in watched.get("noted", []) if one["kind"] == kind]


def place_of(noted: Mapping[str, Any]) -> Place:
    via = f" by {noted['via']}" if noted["via"] else ""
    what = f"in {noted['function']}{via}: {noted['what']}"
    return Place(file=noted["file"], line=noted["line"], what=what)
