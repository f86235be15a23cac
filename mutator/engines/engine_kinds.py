"""The list of engines, with descriptions and factories. Imports no engine."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineKind:
    """An engine.

    `factory` is `module:function`, imported when the engine is made from a `Setting`. `forks`: the engine
    needs a forkable target. `offered`: users can choose it; others are for tests and benchmarks.
    """

    name: str
    about: str
    factory: str
    forks: bool = False
    offered: bool = True


REFERENCE, WARM, FORK = "reference", "warm", "fork"
ENGINES = {
    kind.name: kind
    for kind in (
        EngineKind(
            name=REFERENCE,
            about="a fresh interpreter for each run",
            factory="mutator.engines.reference_engine:make_reference",
        ),
        EngineKind(
            name=WARM,
            about="a fork of the loaded target",
            factory="mutator.engines.fork_engine:make_warm",
            forks=True,
            offered=False,
        ),
        EngineKind(
            name=FORK,
            about="a fork of the golden run",
            factory="mutator.engines.fork_engine:make_fork",
            forks=True,
        ),
    )
}
OFFERED = tuple(name for name, kind in ENGINES.items() if kind.offered)
