"""Says from the source why a place cannot be hit.

Its function is compiled, its file is shadowed by another, or its class copies the default.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES

from mutator.errors import MutatorError
from mutator.model import AnchorKind, FaultLocation
from mutator.mutants.classes_copying_defaults import reason_field_is_copied
from mutator.mutants.jit_compiled_code_in_tree import (
    environment_switch_of_compiler,
    jit_compiler_freezing_constant,
    jit_compiler_of_function,
    tracing_call_of_function,
)
from mutator.mutants.parsed_files_and_anchors import ParsedFile, normalized_function_name, parsed_file
from mutator.mutants.possible_places import ListedPlace
from mutator.targets.manifest import TargetManifest


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceNote:
    """Why a fault cannot act in a function, or on a constant, or acts there only once."""

    line: int  # from 1
    what: str
    reason: str


def check_place_can_be_hit(manifest: TargetManifest, location: FaultLocation) -> None:
    """Raise MutatorError with the reason if a fault at the location could never act."""
    reason = refusal_reason(manifest, location)
    if reason is None:
        return
    file = parsed_file(manifest.tree, location.path)
    compiler = _jit_compiler_at(manifest, location)
    switch = environment_switch_of_compiler(compiler) if compiler else ""
    turning_off = f", or add `{switch}` to `env` of {manifest.path.name}" if switch else ""
    raise MutatorError(
        f"no fault can act here: {reason}",
        where=file.full_path,
        line=file.line_span(location)[0] + 1,
        expected="a place that Python runs or reads",
        remedy=f"inject where the value is used, or where the function's result arrives{turning_off}",
    )


def refusal_reason(manifest: TargetManifest, location: FaultLocation) -> str | None:
    """Return why a fault at the location could never act; None if it can."""
    if location.anchor.kind is not AnchorKind.CONSTANT:
        return refusal_reason_of_function(manifest, location.path, location.function)
    if reason := _refusal_reason_of_file(manifest, location.path):
        return reason
    if compiler := _jit_compiler_at(manifest, location):
        return f"only functions compiled by {compiler} read it, and they keep its first value"
    owner, _, field = location.anchor.name.rpartition(".")
    return reason_field_is_copied(manifest.tree, location.path, owner, field) if owner else None


def refusal_reason_of_function(manifest: TargetManifest, path: str, function: str) -> str | None:
    """Return why Python never runs a function from this file as it stands; None if it can."""
    name = normalized_function_name(function)
    compiler = jit_compiler_of_function(manifest.tree, path, name, manifest.env)
    return _refusal_reason_of_file(manifest, path) or (
        f"{function} is compiled by {compiler}" if compiler else None
    )


def split_by_refusal(
    manifest: TargetManifest, file: ParsedFile, places: Iterable[ListedPlace]
) -> tuple[list[ListedPlace], list[PlaceNote]]:
    """Return the places that can be hit, and notes on the others and on functions that are traced once."""
    usable: list[ListedPlace] = []
    notes: dict[tuple[str, str], PlaceNote] = {}
    reasons: dict[tuple[str, str], str | None] = {}
    for place in places:
        location = place.location
        is_constant = location.anchor.kind is AnchorKind.CONSTANT
        name = location.anchor.name if is_constant else location.function
        key = (location.function, name)
        if key not in reasons:
            reasons[key] = refusal_reason(manifest, location)
        reason = reasons[key]
        if reason is None:
            usable.append(place)
            tracer = None if is_constant else tracing_call_of_function(manifest.tree, location.path, name)
            graph = f"{tracer} runs it once, to build a graph; a fault acts only if it runs again"
            reason = graph if tracer else None
        if reason is not None:
            notes.setdefault((name, reason), PlaceNote(line=place.line, what=name, reason=reason))
    unsettable = [
        PlaceNote(line=value.first_line + 1, what=value.name, reason=value.unsettable_reason)
        for value in file.constants_and_defaults
        if value.unsettable_reason
    ]
    return usable, sorted([*notes.values(), *unsettable], key=lambda note: note.line)


def _jit_compiler_at(manifest: TargetManifest, location: FaultLocation) -> str | None:
    if location.anchor.kind is AnchorKind.CONSTANT:
        return jit_compiler_freezing_constant(
            manifest.tree, location.path, location.anchor.name, manifest.env
        )
    function = normalized_function_name(location.function)
    return jit_compiler_of_function(manifest.tree, location.path, function, manifest.env)


def _refusal_reason_of_file(manifest: TargetManifest, path: str) -> str | None:
    """Return why Python imports another file instead of this one: a package or an extension of its name."""
    stem = path.removesuffix(".py")
    extensions = [f"{stem}{suffix}" for suffix in EXTENSION_SUFFIXES]  # `__init__` can be one, too
    shadow = next(
        (name for name in (f"{stem}/__init__.py", *extensions) if name in manifest.tree.files), None
    )
    return f"{shadow}, beside {path}, is imported in its place" if shadow else None
