"""Choose and make the engine of a campaign."""

import os
import sys
from pkgutil import resolve_name

from mutator._common.message_text import spelling_suggestion
from mutator.engines.engine_jobs import Engine, EngineArguments
from mutator.engines.engine_kinds import ENGINES, FORK, OFFERED_ENGINES, REFERENCE
from mutator.errors import MutatorError
from mutator.targets.manifest import TargetManifest


def choose_engine(engine: str | None, manifest: TargetManifest) -> str:
    """Return the name of the requested engine, or of the fastest that can run this target.

    Raises MutatorError if the requested engine is unknown or cannot run this target here.
    """
    if engine is None:
        return REFERENCE if reason_not_forkable(manifest) else FORK
    why = reason_not_forkable(manifest)
    if engine not in ENGINES:
        check_engine_is_offered(engine)
    if ENGINES[engine].needs_forkable_target and why:
        raise MutatorError(f"engine '{engine}': {why}", argument="engine", remedy=f"use {REFERENCE}")
    return engine


def check_engine_is_offered(engine: str | None) -> None:
    """Raise MutatorError for an engine that users cannot choose; None leaves the choice to the harness."""
    if engine is not None and engine not in OFFERED_ENGINES:
        raise MutatorError(
            f"no engine '{engine}'",
            argument="engine",
            expected=f"one of {', '.join(OFFERED_ENGINES)}",
            remedy="correct the name" + spelling_suggestion(engine, list(OFFERED_ENGINES)),
        )


def make_engine(name: str, arguments: EngineArguments) -> Engine:
    engine: Engine = resolve_name(ENGINES[name].factory)(arguments)
    return engine


def reason_not_forkable(manifest: TargetManifest) -> str:
    """Return why runs of this target are not forked unless requested; empty if they are."""
    if manifest.stepwise_function is None:
        return f"{manifest.path.name} names no `entry.stepwise`"
    if sys.platform != "linux":
        return "processes are forked on Linux only"
    try:
        os.close(os.pidfd_open(os.getpid()))
    except OSError:
        return "this kernel has no pidfd_open"
    return ""
