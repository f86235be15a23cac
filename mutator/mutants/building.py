"""From a fault and a trigger to changed files: built, compiled, diffed, identified."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator._common.hashing import content_id
from mutator.errors import MutatorError
from mutator.faults.fault_models import PROBE_TEMPLATE, FaultModels, SnippetKind
from mutator.model import Fault, Hold, Injection, Trigger
from mutator.mutants import patches as patch
from mutator.mutants import splicing as splice
from mutator.mutants.anchors import ParsedFile
from mutator.mutants.rendering import render, snippet
from mutator.mutants.shapes import Change, Mold, lines_of, proven, shape_of
from mutator.mutants.skeletons import compiles, skeleton
from mutator.targets.locations import check_location
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import check_condition, to_code

OBSERVE_TAG = "observe"


class InvalidMutant(MutatorError):
    """The mutated file does not compile; a mutant that does not compile is never run."""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A mutated tree as its difference from the target. Same fault, trigger, target and templates: same id.

    `files` maps paths relative to the root to the whole new content, changed files and the probe alike.
    """

    id: str
    files: dict[str, bytes]
    patch: str  # git style, a/ and b/ prefixes; applies with `patch -p1` at the root
    tree_digest: str  # of the whole mutated tree
    injections: tuple[str, ...]  # the ids in the tags and in the probe's report, in the fault's order

    @cached_property
    def patch_bytes(self) -> bytes:
        """The patch as it must be written to a file (sources need not be UTF-8)."""
        return self.patch.encode("utf-8", "surrogateescape")


def build(manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger) -> Mutant:
    """The mutant of `manifest`'s tree with `fault` under `trigger`; no fault: the null mutant (probe only).

    `fault.hold` goes before `trigger.hold`. MutatorError when an anchor is not found or ambiguous (candidates
    are listed), InvalidMutant when the result does not compile.
    """
    return _build(manifest, models, fault, trigger, _BY_SHAPE)


def build_directly(
    manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger
) -> Mutant:
    """The mutant with each file spliced, compared and compiled anew: what `build` gives must equal it."""
    return _build(manifest, models, fault, trigger, _DIRECT)


def _build(
    manifest: TargetManifest, models: FaultModels, fault: Fault | None, trigger: Trigger, way: "_Way"
) -> Mutant:
    injections = fault.injections if fault else ()
    names = tuple(injection_id(i, injection) for i, injection in enumerate(injections))
    hold = fault.hold if fault and fault.hold else trigger.hold
    mutant_id = content_id([manifest.tree.digest, models.digest, fault.id if fault else None, trigger])
    edits: dict[str, list[splice.Edit]] = {}
    _add(edits, manifest.observation.location.path, _observation(manifest))
    for name, injection in zip(names, injections, strict=True):
        check_location(manifest, injection.location)
        file = manifest.tree.parsed(injection.location.path)
        _add(edits, file.path, injection_edit(file, models, injection, name))
    probe = _probe(manifest, models, mutant_id, trigger, hold, names)
    way.compile(probe, (mutant_id, *names), models.folder / PROBE_TEMPLATE)
    files = {manifest.probe_path: probe.encode()}
    patches = {manifest.probe_path: patch.new_file(manifest.probe_path, probe)}
    for path, file_edits in edits.items():
        file = manifest.tree.parsed(path)
        change = way.change(file, [splice.probe_import(file, manifest.package), *file_edits], names)
        files[path], patches[path] = change.data, change.patch
    return Mutant(
        id=mutant_id,
        files=dict(sorted(files.items())),
        patch="".join(text for _, text in sorted(patches.items())),
        tree_digest=manifest.tree.digest_with(files),
        injections=names,
    )


def injection_id(index: int, injection: Injection) -> str:
    """The id in an injection's tags: its content and its place in the fault."""
    return content_id([index, injection])[:8]


def injection_edit(file: ParsedFile, models: FaultModels, injection: Injection, name: str) -> splice.Edit:
    """The edit of one injection in its file: anchor resolved, names checked, snippet rendered."""
    model = models.get(injection.model)
    site = file.resolve(injection.location)
    params = dict(injection.params)
    for param in model.params:
        value = params.get(param.name)
        if param.type == "variable" and isinstance(value, str) and value.partition(".")[0] not in site.names:
            raise MutatorError(
                f"'{value}' is not known in {injection.location.function}",
                where=file.where,
                line=site.first + 1,
                expected=f"a name used there: {', '.join(sorted(site.names))}",
                remedy=f"correct `{param.name}`",
            )
    code = snippet(model, params, name)
    make = splice.guard if model.kind is SnippetKind.GUARD else splice.insertion
    return make(file, site, code, name)


def _add(edits: dict[str, list[splice.Edit]], path: str, edit: splice.Edit) -> None:
    edits.setdefault(path, []).append(edit)


def _observation(manifest: TargetManifest) -> splice.Edit:
    observation = manifest.observation
    file = manifest.tree.parsed(observation.location.path)
    arguments = ", ".join(f"{name}={text}" for name, text in observation.expressions)
    return splice.insertion(
        file, file.resolve(observation.location), [f"_fi.observe({arguments})"], OBSERVE_TAG
    )


def _probe(
    manifest: TargetManifest,
    models: FaultModels,
    mutant_id: str,
    trigger: Trigger,
    hold: Hold,
    names: tuple[str, ...],
) -> str:
    if manifest.probe_path in manifest.tree.files:
        raise MutatorError(
            f"the target has a file {manifest.probe_path}",
            where=manifest.root,
            expected="that name free for the probe",
            remedy="rename the target's file, or point the manifest at the original tree",
        )
    if hold is Hold.FOR and trigger.hold_s is None:
        raise MutatorError(f"trigger '{trigger.name}' holds for a time", expected="hold_s with it")
    values = {
        "mutant": mutant_id,
        "condition": to_code(check_condition(trigger.condition)),
        "hold": hold.value,
        "hold_s": float(trigger.hold_s or 0.0),
        "armed_after_s": float(trigger.armed_after_s),
        "injections": names,
    }
    return render(models.probe, values, models.folder / PROBE_TEMPLATE)


def _compile(data: bytes, where: Path) -> None:
    """InvalidMutant unless `data` compiles."""
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


def _compile_probe(text: str, ids: Sequence[str], where: Path) -> None:
    _compile(text.encode(), where)


def _compile_probe_by_shape(text: str, ids: Sequence[str], where: Path) -> None:
    if not compiles(skeleton(text, ids).encode()):
        _compile(text.encode(), where)


def _change(file: ParsedFile, edits: Sequence[splice.Edit], ids: Sequence[str]) -> Change:
    """The file with the edits made: it compiles, and un-splices to the original."""
    pieces = splice.apply(file, edits)
    data = splice.joined(pieces)
    _compile(data, file.where)
    if unsplice(data) != file.data:
        raise InvalidMutant(
            "the mutated file does not un-splice to the original",
            where=file.where,
            remedy="anchor at another statement",
        )
    return Change(data=data, patch=patch.changed_file(file.path, pieces))


def _change_by_shape(file: ParsedFile, edits: Sequence[splice.Edit], ids: Sequence[str]) -> Change:
    """The same from the mold of the shape; the first of a shape is made directly and leaves its mold."""
    shape = shape_of(file, edits, ids)
    mold = file.molds.get(shape)
    if mold is not None:
        return mold.filled(lines_of(edits))
    change = _change(file, edits, ids)
    mold = Mold.of(change)
    if proven(file, mold, shape):
        file.molds[shape] = mold
    return change


@dataclass(frozen=True, slots=True, kw_only=True)
class _Way:
    """How probes are compiled and files changed; the ids are those in the injected lines."""

    compile: Callable[[str, Sequence[str], Path], None]
    change: Callable[[ParsedFile, Sequence[splice.Edit], Sequence[str]], Change]


_DIRECT = _Way(compile=_compile_probe, change=_change)
_BY_SHAPE = _Way(compile=_compile_probe_by_shape, change=_change_by_shape)


def unsplice(data: bytes) -> bytes:
    """The original bytes of a mutated file: tagged lines removed, a guarded statement put back."""
    return splice.unsplice(data.splitlines(keepends=True))


def write_tree(manifest: TargetManifest, mutant: Mutant, dest: Path) -> None:
    """Write the mutated tree (the manifest's files, so no bytecode) below `dest`."""
    for path, data in {**manifest.tree.files, **mutant.files}.items():
        place = dest / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
