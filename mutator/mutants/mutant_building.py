"""Builds mutants: turns a fault and a trigger into changed files, a patch and an id."""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.hashing import content_id
from mutator.errors import InvalidMutant, MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.faults.probe_template_parts import CODE_TEMPLATE_FILE as PROBE_CODE
from mutator.model import LOAD_TIME_ANCHORS, Fault, Hold, Trigger
from mutator.mutants.changed_file_reuse import (
    ChangedFile,
    ReusableChangedFile,
    compiles_for_every_mutant,
    inserted_lines,
    reuse_cache,
    reuse_key,
)
from mutator.mutants.compile_check_by_function import certainly_compiles_for_key
from mutator.mutants.injected_line_syntax import OBSERVATION_TAG, observation_call_source
from mutator.mutants.injection_edits import InjectionEdit, edits_of
from mutator.mutants.normalized_source import normalize_numbers_and_ids, normalized_source_compiles
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.mutants.patch_rendering import render_changed_file, render_new_file
from mutator.mutants.probe_contract import ProbeSource, build_probe_settings, probe_path, render_probe
from mutator.mutants.splicing import (
    EditRank,
    ExpressionEdit,
    LineEdit,
    apply_edits,
    as_line_edits,
    insertion_edit,
    mutated_bytes,
    probe_import_edit,
    unsplice,
)
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import SourceTree

_MOST_RECENT_FAULTS = 400  # with some 10 kB each


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A mutated tree, stored as its difference from the target.

    The id depends only on fault, trigger, target and templates.
    """

    id: str
    files: dict[str, bytes]  # full new content by path, including the probe
    patch: str  # git style, a/ and b/ prefixes; applies with `patch -p1` at the root
    tree_digest: str  # of the whole mutated tree
    probe_source: ProbeSource
    injection_ids: tuple[str, ...]  # ids used in tags and in the probe's report, in the fault's order
    ids_before_anchor: frozenset[str]  # those whose lines stand above the statement of their anchor

    @cached_property
    def patch_bytes(self) -> bytes:
        """The patch as bytes, because sources need not be UTF-8."""
        return self.patch.encode("utf-8", "surrogateescape")


def build(manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger) -> Mutant:
    """Build the mutant of `manifest`'s tree with `fault` under `trigger`; without a fault, the null mutant.

    `fault.hold` overrides `trigger.hold`. MutatorError with candidates if an anchor is missing or ambiguous,
    InvalidMutant if the result does not compile.
    """
    return _build_with_splicer(manifest, models, fault, trigger, _ReusingSplicer(manifest.tree))


def build_without_reusing_changed_files(
    manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger
) -> Mutant:
    """Like `build`, but splice and compile every file, even if an earlier mutant changed it in the same way.

    `build` must return the same bytes.
    """
    return _build_with_splicer(manifest, models, fault, trigger, _Splicer())


def _build_with_splicer(
    manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger, splicer: "_Splicer"
) -> Mutant:
    hold = fault.hold if fault and fault.hold else trigger.hold
    mutant_id = content_id([manifest.tree.digest, models.digest, fault.id if fault else None, trigger])
    common = splicer.change_files(manifest, models, fault)
    probe_file = probe_path(manifest.probe_package)
    probe = _build_probe(manifest, models, mutant_id, trigger, hold, common.ids, common.sets_on_load)
    text = probe.text
    splicer.check_probe_compiles(text, (mutant_id, *common.ids), models.folder / PROBE_CODE)
    files, patches = {probe_file: text.encode()}, {probe_file: render_new_file(probe_file, text)}
    for path, change in common.change_by_path.items():
        files[path], patches[path] = change.data, change.patch
    return Mutant(
        id=mutant_id,
        files=dict(sorted(files.items())),
        patch="".join(text for _, text in sorted(patches.items())),
        tree_digest=manifest.tree.digest_with_changes(files),
        probe_source=probe,
        injection_ids=common.ids,
        ids_before_anchor=common.ids_before_anchor,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _FaultInFiles:
    """What all mutants with a fault have in common: all but their probe, which has the trigger.

    `sets_on_load`: whether the fault sets constants or defaults.
    """

    ids: tuple[str, ...]
    ids_before_anchor: frozenset[str]
    sets_on_load: bool
    change_by_path: Mapping[str, ChangedFile]


def _edits_by_path(
    manifest: TargetManifest, injection_edits: Sequence[InjectionEdit]
) -> dict[str, list[LineEdit]]:
    edits: dict[str, list[LineEdit | ExpressionEdit]] = {
        manifest.observation.location.path: [_observation_edit(manifest)]
    }
    for injection_edit in injection_edits:
        edits.setdefault(injection_edit.file.path, []).append(injection_edit.edit)
    return {
        path: as_line_edits(parsed_file(manifest.tree, path), file_edits)
        for path, file_edits in edits.items()
    }


def _ids_before_anchor(injection_edits: Sequence[InjectionEdit]) -> frozenset[str]:
    return frozenset(
        change.id
        for change in injection_edits
        if isinstance(change.edit, LineEdit) and change.edit.rank in (EditRank.BEFORE, EditRank.GUARD)
    )


def _observation_edit(manifest: TargetManifest) -> LineEdit:
    observation = manifest.observation
    file = parsed_file(manifest.tree, observation.location.path)
    anchor = file.resolve_statement(observation.location)
    return insertion_edit(
        file, anchor, [observation_call_source(observation.name_expression_pairs)], OBSERVATION_TAG
    )


def _build_probe(
    manifest: TargetManifest,
    models: FaultModels,
    mutant_id: str,
    trigger: Trigger,
    hold: Hold,
    ids: tuple[str, ...],
    sets_constants_or_defaults: bool,
) -> ProbeSource:
    # also a package or an extension module of this name would be imported instead of the probe
    probe_stem = probe_path(manifest.probe_package).removesuffix("py")
    if clashes := [
        path for path in manifest.tree.files if path.startswith((probe_stem, f"{probe_stem[:-1]}/"))
    ]:
        raise MutatorError(
            f"the target has a file {clashes[0]}",
            where=manifest.root,
            expected="no file of this name, because the probe uses it",
            remedy="rename the target's file, or point the manifest at the original tree",
        )
    observation, step_s = manifest.observation, manifest.step_s
    settings = build_probe_settings(
        mutant_id, trigger, hold, ids, observation, step_s, sets=sets_constants_or_defaults
    )
    return render_probe(models.probe_templates, settings)


def _check_compiles(data: bytes, where: Path) -> None:
    try:
        compile(data, str(where), "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError) as error:
        line = error.lineno if isinstance(error, SyntaxError) else None
        text = data.splitlines()[line - 1].decode("utf-8", "replace").strip() if line else ""
        raise InvalidMutant(
            f"the mutated file does not compile: {error.args[0]}" + (f" at `{text}`" if text else ""),
            where=where,
            remedy="correct the template, or anchor at another statement",
        ) from None


class _Splicer:
    """Splices and compiles every file. `ids` are the ids in the injected lines."""

    def change_files(
        self, manifest: TargetManifest, models: FaultModels, fault: Fault | None
    ) -> _FaultInFiles:
        injections = fault.injections if fault else ()
        injection_edits = edits_of(manifest, models, injections)
        ids = tuple(change.id for change in injection_edits)
        change_by_path = {}
        for path, edits in _edits_by_path(manifest, injection_edits).items():
            file = parsed_file(manifest.tree, path)
            probe_import = probe_import_edit(file, manifest.probe_package)
            change_by_path[path] = self.splice_and_compile(file, [probe_import, *edits], ids)
        return _FaultInFiles(
            ids=ids,
            ids_before_anchor=_ids_before_anchor(injection_edits),
            sets_on_load=any(i.location.anchor.kind in LOAD_TIME_ANCHORS for i in injections),
            change_by_path=change_by_path,
        )

    def check_probe_compiles(self, text: str, ids: Sequence[str], where: Path) -> None:
        _check_compiles(text.encode(), where)

    def splice_and_compile(
        self, file: ParsedFile, edits: Sequence[LineEdit], ids: Sequence[str]
    ) -> ChangedFile:
        change = self.splice(file, edits)
        _check_compiles(change.data, file.full_path)
        return change

    def splice(self, file: ParsedFile, edits: Sequence[LineEdit]) -> ChangedFile:
        pieces = apply_edits(file, edits)
        data = mutated_bytes(pieces)
        if unsplice(data) != file.data:
            raise InvalidMutant(
                "removing the injected lines from the mutated file does not restore the original",
                where=file.full_path,
                remedy="anchor at another statement",
            )
        return ChangedFile(data=data, patch=render_changed_file(file.path, pieces))


class _RecentFaults:
    """The faults that were built last in a tree. Triggers take turns, so each fault comes again and again."""

    def __init__(self, tree: SourceTree) -> None:
        self.entries: OrderedDict[tuple[int, int, str], tuple[TargetManifest, FaultModels, _FaultInFiles]] = (
            OrderedDict()
        )


class _ReusingSplicer(_Splicer):
    """Reuses a known change of a file if possible; otherwise splices the file and keeps the change."""

    def __init__(self, tree: SourceTree) -> None:
        self._tree = tree

    def change_files(
        self, manifest: TargetManifest, models: FaultModels, fault: Fault | None
    ) -> _FaultInFiles:
        recent = self._tree.derive_once_from_all(_RecentFaults)
        key = (id(manifest), id(models), fault.id if fault else "")
        if key not in recent.entries:
            in_files = super().change_files(manifest, models, fault)
            recent.entries[key] = (manifest, models, in_files)  # keeps both alive, and so their ids
            if len(recent.entries) > _MOST_RECENT_FAULTS:
                recent.entries.popitem(last=False)
        recent.entries.move_to_end(key)
        return recent.entries[key][2]

    def check_probe_compiles(self, text: str, ids: Sequence[str], where: Path) -> None:
        if not normalized_source_compiles(normalize_numbers_and_ids(text, ids).encode()):
            super().check_probe_compiles(text, ids, where)

    def splice_and_compile(
        self, file: ParsedFile, edits: Sequence[LineEdit], ids: Sequence[str]
    ) -> ChangedFile:
        cache = reuse_cache(self._tree, file.path)
        key = reuse_key(file, edits, ids)
        if key in cache:
            cached = cache[key]
            if isinstance(cached, ChangedFile):  # only on reuse: most changes of values are used once
                cached = cache[key] = ReusableChangedFile.from_changed_file(cached)
            return cached.with_inserted_lines(inserted_lines(edits))
        if certainly_compiles_for_key(file, edits, key):
            cache[key] = change = self.splice(file, edits)
            return change
        change = super().splice_and_compile(file, edits, ids)
        reusable = ReusableChangedFile.from_changed_file(change)
        if compiles_for_every_mutant(file, reusable, key):
            cache[key] = reusable
        return change


def write_mutated_tree(manifest: TargetManifest, mutant: Mutant, dest: Path) -> None:
    for path, data in {**manifest.tree.files, **mutant.files}.items():
        place = path_below(dest, path)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
