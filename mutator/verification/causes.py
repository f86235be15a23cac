"""Why a target is likely not deterministic: lines that were seen at work in a run, or found by reading."""

from collections.abc import Mapping
from typing import Any

from mutator.engines.in_target.watch import CLOCK, DRAW, HASH, PROCESS, THREAD
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches
from mutator.verification import set_order
from mutator.verification.findings import Place

_MOST = 5
_REMEDIES = {
    CLOCK: "count time in steps: `step * dt`",
    DRAW: "draw from `numpy.random.default_rng(seed)` with the run's seed",
    THREAD: "do that work in the step itself",
    PROCESS: "let nothing depend on an address or a process's number",
    HASH: "let nothing depend on a hash; use `sorted(...)` where a set's order counts",
}
_UNKNOWN = (
    "nothing in the target's own lines was seen to read a clock, draw without a seed or start a thread; "
    "look at what it reads (files, the network), and at state that its libraries keep"
)


def likely(manifest: TargetManifest, watched: Mapping[str, Any], *, by_hash: bool) -> tuple[list[Place], str]:
    """The lines that are likely to blame, the likeliest first, and what to do.

    `by_hash` says that runs with one PYTHONHASHSEED agree, and with another do not: then a set's order or a
    hash is to blame. `watched` is what a watched run noted.
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
    """Where files of the target go through a set in its order, those that may have faults first."""
    found = []
    for path in sorted(manifest.tree.files, key=lambda path: (matches(path, manifest.forbid), path)):
        if path.endswith(".py"):
            for one in set_order.places(manifest.tree.files[path]):
                what = f"in {one.function}: goes through a set in its order, {one.what}"
                found.append(Place(file=path, line=one.line, what=what))
    return found


def of_kind(watched: Mapping[str, Any], kind: str) -> list[Place]:
    """The lines of one kind that a watched run noted."""
    return [place_of(one) for one in watched.get("noted", []) if one["kind"] == kind]


def place_of(noted: Mapping[str, Any]) -> Place:
    """A line that a watched run noted."""
    via = f" by {noted['via']}" if noted["via"] else ""
    what = f"in {noted['function']}{via}: {noted['what']}"
    return Place(file=noted["file"], line=noted["line"], what=what)
