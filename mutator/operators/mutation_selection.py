"""Selects mutations by operator, by place in the source, and by the lines that golden runs execute."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from mutator._common.hashing import digest
from mutator._common.message_text import counted, spelling_suggestion
from mutator._common.random_streams import random_generator
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.mutants.refused_places import refusal_reason_of_function
from mutator.operators.equal_code_filter import drop_equal_code
from mutator.operators.executed_lines_and_types import TypesByFileAndLine
from mutator.operators.mutation_listing import mutations_of
from mutator.operators.mutations import Mutation
from mutator.operators.statement_facts import statement_facts_of
from mutator.targets.allowed_locations import check_file_allowed
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import matches_any_glob

LinesByFile = Mapping[str, Collection[int]]  # by file, from 1
_MOST_NAMED_FILES = 20
_WILDCARDS = "*?["  # of `fnmatch`; a path without one must be a file of the target


@dataclass(frozen=True, slots=True, kw_only=True)
class SelectedMutations:
    """The selected mutations, and the numbers of those left out, by reason."""

    mutations: tuple[Mutation, ...] = ()
    unexecuted_count: int = 0  # no golden run executes the line
    compiled_count: int = 0  # Python never runs the function as it stands
    equal_to_original_count: int = 0  # same code as the original
    duplicate_count: int = 0  # same code as an earlier mutation
    invalid_count: int = 0  # does not compile
    refused_files: tuple[str, ...] = ()  # that wildcards match: `PATH:LINE: REASON`

    @property
    def summary(self) -> str:
        """A summary of the numbers for the user."""
        left_out = {
            "in lines that no golden run executes": self.unexecuted_count,
            "in functions that are compiled or shadowed": self.compiled_count,
            "with the code of the original": self.equal_to_original_count,
            "with the code of another": self.duplicate_count,
            "that do not compile": self.invalid_count,
        }
        parts = [f"{number} {what}" for what, number in left_out.items() if number]
        if self.refused_files:
            parts.append(f"all in {self._description_of_refused_files}")
        rest = f"; left out: {', '.join(parts)}" if parts else ""
        return counted(len(self.mutations), "mutant of operators", "mutants of operators") + rest

    @property
    def _description_of_refused_files(self) -> str:
        named, rest = self.refused_files[:_MOST_NAMED_FILES], len(self.refused_files) - _MOST_NAMED_FILES
        more = (f"{rest} more",) if rest > 0 else ()
        count = counted(
            len(self.refused_files), "file that cannot be changed", "files that cannot be changed"
        )
        return f"{count} ({'; '.join(named + more)})"


def select_mutations(
    manifest: TargetManifest,
    models: FaultModels,
    operators: Collection[str],
    places: Sequence[str],
    executed: LinesByFile | None = None,
    types: TypesByFileAndLine | None = None,
) -> SelectedMutations:
    """Return the operators' mutations at these places, sorted by file and line.

    A place is `PATH` or `PATH::FUNCTION`; `*` is a wildcard, and `**` also matches across folders. `executed`
    limits the mutations to these lines; `types` are those of variables in golden runs. MutatorError if a
    place matches nothing.
    """
    functions_by_path: dict[str, dict[str, None]] = {}
    refusal_by_path: dict[str, MutatorError] = {}
    for place in places:
        for path, function in _functions_at(manifest, place, refusal_by_path):
            functions_by_path.setdefault(path, {})[function] = None
    selected = SelectedMutations(
        refused_files=tuple(_short_refusal(path, refusal_by_path[path]) for path in sorted(refusal_by_path))
    )
    for path in sorted(functions_by_path):
        selected = _merge(
            selected,
            _select_in_file(manifest, models, operators, path, functions_by_path[path], executed, types),
        )
    return selected


def _select_in_file(
    manifest: TargetManifest,
    models: FaultModels,
    operators: Collection[str],
    path: str,
    functions: Collection[str],
    executed: LinesByFile | None,
    types: TypesByFileAndLine | None,
) -> SelectedMutations:
    file, facts = parsed_file(manifest.tree, path), statement_facts_of(manifest.tree, path)
    if types is not None:
        facts = replace(facts, types_by_line=types.get(path, {}))
    mutations_by_function = {name: mutations_of(file, facts, name, models, operators) for name in functions}
    refused = {name for name in functions if refusal_reason_of_function(manifest, path, name)}
    mutations = [m for name in functions if name not in refused for m in mutations_by_function[name]]
    lines = None if executed is None else facts.extend_to_statements(executed.get(path, ()))
    executed_mutations = (
        mutations if lines is None else [mutation for mutation in mutations if mutation.line + 1 in lines]
    )
    distinct_mutations = drop_equal_code(file, executed_mutations)
    return SelectedMutations(
        mutations=distinct_mutations.mutations,
        unexecuted_count=len(mutations) - len(executed_mutations),
        compiled_count=sum(len(mutations_by_function[name]) for name in refused),
        equal_to_original_count=distinct_mutations.equal_to_original_count,
        duplicate_count=distinct_mutations.duplicate_count,
        invalid_count=distinct_mutations.invalid_count,
    )


def _merge(first: SelectedMutations, second: SelectedMutations) -> SelectedMutations:
    return SelectedMutations(
        mutations=first.mutations + second.mutations,
        unexecuted_count=first.unexecuted_count + second.unexecuted_count,
        compiled_count=first.compiled_count + second.compiled_count,
        equal_to_original_count=first.equal_to_original_count + second.equal_to_original_count,
        duplicate_count=first.duplicate_count + second.duplicate_count,
        invalid_count=first.invalid_count + second.invalid_count,
        refused_files=first.refused_files + second.refused_files,
    )


def _functions_at(
    manifest: TargetManifest, place: str, refusal_by_path: dict[str, MutatorError]
) -> Iterator[tuple[str, str]]:
    """Yield path and qualified name of each function that a place names; MutatorError if there is none.

    A file that a wildcard matches and that cannot be parsed is only noted in `refusal_by_path`.
    """
    path, _, function = place.partition("::")
    files = list(_parsed_files_at(manifest, path, refusal_by_path))
    matching = [
        (file.path, name)
        for file in files
        for name in file.functions_by_name
        if fnmatchcase(name, function.replace(".<locals>", "") or "*")
    ]
    if not matching:
        if not files:
            raise next(iter(refusal_by_path.values()))
        names = list(files[0].functions_by_name)
        raise MutatorError(
            f"no function '{function}' in {path}" if function else f"no function in {path}",
            argument="in",
            expected=f"one of {', '.join(names)}" if function and names else "a file with functions",
            remedy="correct the place" + spelling_suggestion(function, names),
        )
    yield from matching


def _parsed_files_at(
    manifest: TargetManifest, path: str, refusal_by_path: dict[str, MutatorError]
) -> Iterator[ParsedFile]:
    for file_path in _paths_at(manifest, path):
        try:
            yield parsed_file(manifest.tree, file_path)
        except MutatorError as refusal:
            if not _has_wildcard(path):
                raise
            refusal_by_path[file_path] = refusal


def _short_refusal(path: str, refusal: MutatorError) -> str:
    return f"{path}:{refusal.line}: {refusal.got}" if refusal.line else f"{path}: {refusal.got}"


def _has_wildcard(path: str) -> bool:
    return any(character in path for character in _WILDCARDS)


def _paths_at(manifest: TargetManifest, path: str) -> list[str]:
    if not _has_wildcard(path):
        check_file_allowed(manifest, path)
        return [path]
    matching = [
        file
        for file in manifest.tree.files
        if matches_any_glob(file, [path]) and _can_be_mutated(manifest, file)
    ]
    if not matching:
        raise MutatorError(
            f"no file of target {manifest.name} matches '{path}'",
            argument="in",
            expected="PATH or PATH::FUNCTION, in files that can be changed; `*` is a wildcard, `**` also "
            "matches across folders",
            remedy="correct the place",
        )
    return sorted(matching)


def _can_be_mutated(manifest: TargetManifest, path: str) -> bool:
    try:
        check_file_allowed(manifest, path)
    except MutatorError:
        return False
    return True


def sample_mutations(selected: SelectedMutations, count: int | None, seed: int) -> tuple[Mutation, ...]:
    """Sample `count` mutations, stratified by operator and function. They keep their order.

    The sample is systematic over a seeded order, so each mutation has the same chance.
    """
    total = len(selected.mutations)
    if count is None or count >= total:
        return selected.mutations
    strata_order = sorted(range(total), key=lambda i: _stratum_sort_key(selected.mutations[i], seed))
    start = float(random_generator(seed, "operators").random())
    chosen = {strata_order[int((k + start) * total / count)] for k in range(count)}
    return tuple(selected.mutations[i] for i in sorted(chosen))


def _stratum_sort_key(mutation: Mutation, seed: int) -> tuple[str, ...]:
    at = mutation.location
    what = [seed, at, mutation.model, mutation.params]
    return (mutation.operator, at.path, at.function, digest(what))
