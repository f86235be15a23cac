"""Selects mutations by operator, by place in the source, and by the lines that golden runs execute."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from mutator._common.hashing import digest
from mutator._common.message_text import counted, suggestion
from mutator._common.random_streams import generator
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.mutants.anchors import parsed
from mutator.operators.equal_code_filter import distinct
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutations import Mutation
from mutator.operators.statement_facts import facts_of
from mutator.targets.allowed_locations import check_file
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches

Lines = Mapping[str, Collection[int]]  # by file, from 1
_GLOB = "*?["


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The selected mutations, and the numbers of those left out, by reason."""

    mutations: tuple[Mutation, ...] = ()
    unexecuted: int = 0  # no golden run executes the line
    equal: int = 0  # same code as the original
    twins: int = 0  # same code as an earlier mutation
    invalid: int = 0  # does not compile

    @property
    def told(self) -> str:
        """A summary of the numbers for the user."""
        left_out = {
            "in lines that no golden run executes": self.unexecuted,
            "with the code of the original": self.equal,
            "with the code of another": self.twins,
            "that do not compile": self.invalid,
        }
        parts = [f"{number} {what}" for what, number in left_out.items() if number]
        rest = f"; left out: {', '.join(parts)}" if parts else ""
        return counted(len(self.mutations), "mutant of operators", "mutants of operators") + rest


def find_mutations(
    manifest: TargetManifest,
    models: FaultModels,
    operators: Collection[str],
    places: Sequence[str],
    executed: Lines | None = None,
) -> Found:
    """Return the operators' mutations at these places, sorted by file and line.

    A place is `PATH` or `PATH::FUNCTION`; `*` is a wildcard, and `**` also matches across folders. `executed`
    limits the mutations to these lines. MutatorError if a place matches nothing.
    """
    wanted: dict[str, dict[str, None]] = {}
    for place in places:
        for path, function in _functions(manifest, place):
            wanted.setdefault(path, {})[function] = None
    found = Found()
    for path in sorted(wanted):
        found = _added(found, _in_file(manifest, models, operators, path, wanted[path], executed))
    return found


def _in_file(
    manifest: TargetManifest,
    models: FaultModels,
    operators: Collection[str],
    path: str,
    functions: Collection[str],
    executed: Lines | None,
) -> Found:
    file, facts = parsed(manifest.tree, path), facts_of(manifest.tree, path)
    made = [one for name in functions for one in mutations_of(file, facts, name, models, operators)]
    lines = None if executed is None else facts.executed(executed.get(path, ()))
    ran = made if lines is None else [one for one in made if one.line + 1 in lines]
    kept = distinct(file, ran)
    return Found(
        mutations=kept.mutations,
        unexecuted=len(made) - len(ran),
        equal=kept.equal,
        twins=kept.twins,
        invalid=kept.invalid,
    )


def _added(one: Found, other: Found) -> Found:
    return Found(
        mutations=one.mutations + other.mutations,
        unexecuted=one.unexecuted + other.unexecuted,
        equal=one.equal + other.equal,
        twins=one.twins + other.twins,
        invalid=one.invalid + other.invalid,
    )


def _functions(manifest: TargetManifest, place: str) -> Iterator[tuple[str, str]]:
    """Yield path and qualified name of each function that a place names; MutatorError if there is none."""
    path, _, function = place.partition("::")
    paths = _paths(manifest, path)
    hits = [
        (path, name)
        for path in paths
        for name in parsed(manifest.tree, path).functions
        if fnmatchcase(name, function.replace(".<locals>", "") or "*")
    ]
    if not hits:
        known = [name for path in paths[:1] for name in parsed(manifest.tree, path).functions]
        raise MutatorError(
            f"no function '{function}' in {path}" if function else f"no function in {path}",
            argument="in",
            expected=f"one of {', '.join(known)}" if function and known else "a file with functions",
            remedy="correct the place" + suggestion(function, known),
        )
    yield from hits


def _paths(manifest: TargetManifest, path: str) -> list[str]:
    if not any(c in path for c in _GLOB):
        check_file(manifest, path)
        return [path]
    hits = [one for one in manifest.tree.files if matches(one, [path]) and _may_be_mutated(manifest, one)]
    if not hits:
        raise MutatorError(
            f"no file of target {manifest.name} matches '{path}'",
            argument="in",
            expected="PATH or PATH::FUNCTION, in files that can be changed; `*` is a wildcard, `**` also "
            "matches across folders",
            remedy="correct the place",
        )
    return sorted(hits)


def _may_be_mutated(manifest: TargetManifest, path: str) -> bool:
    try:
        check_file(manifest, path)
    except MutatorError:
        return False
    return True


def sampled(found: Found, count: int | None, seed: int) -> tuple[Mutation, ...]:
    """Sample `count` mutations, stratified by operator and function. They keep their order.

    The sample is systematic over a seeded order, so each mutation has the same chance.
    """
    total = len(found.mutations)
    if count is None or count >= total:
        return found.mutations
    places = sorted(range(total), key=lambda i: _stratum(found.mutations[i], seed))
    start = float(generator(seed, "operators").random())
    chosen = {places[int((k + start) * total / count)] for k in range(count)}
    return tuple(found.mutations[i] for i in sorted(chosen))


def _stratum(mutation: Mutation, seed: int) -> tuple[str, ...]:
    at = mutation.location
    what = [seed, at, mutation.model, mutation.params]
    return (mutation.operator, at.path, at.function, digest(what))
