"""Choose and make the engine of a campaign."""

import os
import sys
from pkgutil import resolve_name

from mutator.engines.engine_jobs import Engine, Setting
from mutator.engines.engine_kinds import ENGINES, FORK, OFFERED, REFERENCE
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest

WORTH_IT = 40  # with fewer experiments, the equivalence check would rerun most of them


def choose_engine(asked: str | None, manifest: TargetManifest, experiments: int) -> str:
    """Return the name of the requested engine, or of the fastest that pays off for this many experiments.

    Raises MutatorError if the requested engine is unknown or cannot run this target here.
    """
    if asked is None:
        return REFERENCE if not_worth_forking(manifest, experiments) else FORK
    why = not_forkable(manifest)
    if asked not in ENGINES:
        check_offered(asked)
    if ENGINES[asked].forks and why:
        raise MutatorError(f"engine '{asked}': {why}", argument="engine", remedy=f"use {REFERENCE}")
    return asked


def check_offered(asked: str | None) -> None:
    """Raise MutatorError for an engine that users cannot choose; None leaves the choice to the harness."""
    if asked is not None and asked not in OFFERED:
        raise MutatorError(f"engine '{asked}'", argument="engine", expected=f"one of {', '.join(OFFERED)}")


def make_engine(name: str, setting: Setting) -> Engine:
    engine: Engine = resolve_name(ENGINES[name].factory)(setting)
    return engine


def not_worth_forking(manifest: TargetManifest, experiments: int) -> str:
    """Return why this many experiments are not forked unless requested; empty if they are."""
    few = f"forking pays off only with {WORTH_IT} or more experiments" if experiments < WORTH_IT else ""
    return not_forkable(manifest) or few


def not_forkable(manifest: TargetManifest) -> str:
    if manifest.stepwise is None:
        return f"{manifest.path.name} names no `entry.stepwise`"
    if sys.platform != "linux":
        return "processes are forked on Linux only"
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:
        return "this kernel has no pidfd_open"
    return ""
