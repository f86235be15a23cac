"""What a run depends on: digests of its sources, versions of what runs them."""

import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.errors import MutatorError
from mutator.store.run_head import SCHEMA
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

_REMEDY = "undo the change, or run into another folder"


def sources(workspace: Workspace, manifest: TargetManifest, scenarios: set[str]) -> dict[str, str]:
    """Digest of everything outside the plan that a result depends on, by name."""
    return {
        "target": manifest.tree.digest,
        "manifest": digest(manifest.path.read_bytes()),
        "templates": workspace.fault_models().digest,
        **{f"scenario {s}": digest(workspace.scenario(s).read_bytes()) for s in sorted(scenarios)},
    }


def check_sources(run: Path, frozen: dict[str, str], now: dict[str, str]) -> None:
    """MutatorError when a source is no longer what it was when the plan was frozen."""
    changed = [name for name in frozen if now.get(name) != frozen[name]]
    if changed:
        raise MutatorError(
            f"changed since this run was planned: {', '.join(changed)}",
            where=run,
            expected="the same target, templates and scenarios during a whole run",
            remedy=_REMEDY,
        )


def check_version(run: Path, schema: str, provenance: Mapping[str, Any]) -> None:
    """MutatorError when a run folder is of another schema or version of mutator than this one.

    Such a folder can be read in every way, but not be run on: all its results come from one program.
    """
    if (schema, provenance["mutator"]) != (SCHEMA, VERSION):
        raise MutatorError(
            f"was planned by mutator {provenance['mutator']} ({schema})",
            where=run,
            expected=f"mutator {VERSION} ({SCHEMA})",
            remedy="finish it with that version, or run into another folder; this one can still be read",
        )


def versions() -> dict[str, Any]:
    """Versions of mutator, Python, and every installed package (any of them may be the target's)."""
    packages = {d.metadata["Name"].lower(): d.version for d in metadata.distributions()}
    return {
        "mutator": VERSION,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "packages": dict(sorted(packages.items())),
    }
