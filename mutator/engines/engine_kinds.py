"""The list of engines, with descriptions and factories. Imports no engine."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineKind:
    """An engine.

    `factory` is `module:function`, imported when the engine is made from `EngineArguments`. Users can choose
    it if `is_offered`; others are for tests and benchmarks.
    """

    name: str
    about: str
    factory: str
    needs_forkable_target: bool = False
    is_offered: bool = True


REFERENCE, WARM, FORK = "reference", "warm", "fork"
ENGINES = {
    kind.name: kind
    for kind in (
        EngineKind(
            name=REFERENCE,
            about="a fresh interpreter for each run",
            factory="mutator.engines.reference_engine:make_reference_engine",
        ),
        EngineKind(
            name=WARM,
            about="a fork of the loaded target",
            factory="mutator.engines.fork_engine:make_warm_engine",
            needs_forkable_target=True,
            is_offered=False,
        ),
        EngineKind(
            name=FORK,
            about="a fork of the golden run",
            factory="mutator.engines.fork_engine:make_fork_engine",
            needs_forkable_target=True,
        ),
    )
}
OFFERED_ENGINES = tuple(name for name, kind in ENGINES.items() if kind.is_offered)
