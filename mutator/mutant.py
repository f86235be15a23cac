"""From a fault and a trigger to changed files: built, compiled, diffed, identified."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator.errors import MutatorError
from mutator.fault_models import FaultModels
from mutator.manifest import TargetManifest
from mutator.model import Fault, Trigger


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
    raise NotImplementedError


def unsplice(data: bytes) -> bytes:
    """The original bytes of a mutated file: tagged lines removed, a guarded statement put back."""
    raise NotImplementedError


def copy_base(manifest: TargetManifest, dest: Path) -> None:
    """Write the manifest's pristine tree (its listed files only, so no bytecode) to the new folder `dest`."""
    raise NotImplementedError


def write_tree(mutant: Mutant, base_tree: Path, dest: Path) -> None:
    """Copy `base_tree` (made by `copy_base`) to the new folder `dest` and put the mutant's files in."""
    raise NotImplementedError


def digest_folder(manifest: TargetManifest, root: Path) -> str:
    """Tree digest of a tree on disk, comparable with `Mutant.tree_digest` and `manifest.tree.digest`."""
    raise NotImplementedError
