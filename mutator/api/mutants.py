"""A mutant: a fault built into the target's source, with its diff, files and tree."""

from dataclasses import dataclass
from pathlib import Path

from mutator._common.files import make_folder
from mutator.api.notebook_html import diff_html, text_html
from mutator.api.target_and_fault_selection import FaultLike, SelectedTarget, TriggerLike, WorkspaceLike
from mutator.errors import MutatorError
from mutator.model import Fault, Trigger
from mutator.mutants.mutant_building import Mutant, build, write_mutated_tree
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.targets.manifest import TargetManifest


@dataclass(frozen=True, kw_only=True, repr=False)
class BuiltMutant:
    """A fault with a trigger, built into a target."""

    fault: Fault  #: the injected fault
    trigger: Trigger  #: when it is active
    mutant: Mutant  #: the changed files, and the digest of the tree
    manifest: TargetManifest  #: the target's manifest

    def __repr__(self) -> str:
        return f"<BuiltMutant {self.id}: {self.fault.label}, {self.trigger.name}>"

    def _repr_html_(self) -> str:
        return text_html(repr(self)) + diff_html(self.diff)

    @property
    def id(self) -> str:
        """Content hash of fault, trigger, target and templates."""
        return self.mutant.id

    @property
    def patch(self) -> str:
        """The whole patch, including the probe; apply it with `patch -p1` at the target's root."""
        return self.mutant.patch

    @property
    def diff(self) -> str:
        """The patch without the probe, for reading."""
        return patch_without_new_files(self.patch)[0]

    @property
    def files(self) -> dict[str, bytes]:
        """The content of each file that differs from the target's, by path below the root."""
        return self.mutant.files

    def write(self, folder: str | Path) -> Path:
        """Write the whole mutated source tree into a new or empty folder, and return the folder."""
        out = Path(folder)
        make_folder(out)
        if any(out.iterdir()):  # files of another tree would become part of this one
            raise MutatorError(
                "not empty", where=out, expected="a new or empty folder", remedy="choose another folder"
            )
        write_mutated_tree(self.manifest, self.mutant, out)
        return out


def build_mutant(
    fault: FaultLike,
    trigger: TriggerLike = "always",
    *,
    value: float | None = None,
    reading: str | None = None,
    seed: int = 0,
    target: str | None = None,
    workspace: WorkspaceLike = None,
) -> BuiltMutant:
    """Build a fault into the target's source, without running or writing anything.

    `fault` is a Fault, a spec (`sensor/bias`), one of its variants (`sensor/bias/distance`), or a spec file.
    The fault gets `value`, in the spec's unit; default: the middle one of the drawn values. `trigger` is a
    Trigger, a context (`C2`), a time in s, `always`, or a condition (`gap <= 2`). `target` names a manifest;
    default: the library's only one.

    MutatorError for an invalid argument, and if a place is not found in the source; InvalidMutant (a
    MutatorError) if the mutant does not compile.
    """
    selected_target = SelectedTarget.of(workspace, target)
    selected_fault = selected_target.fault(fault, value=value, seed=seed, reading=reading)
    return build_selected(selected_target, selected_fault, selected_target.trigger(trigger))


def build_selected(selected_target: SelectedTarget, fault: Fault, trigger: Trigger) -> BuiltMutant:
    """Build the mutant of a fault with a trigger."""
    mutant = build(selected_target.manifest, selected_target.models, fault, trigger)
    return BuiltMutant(fault=fault, trigger=trigger, mutant=mutant, manifest=selected_target.manifest)
