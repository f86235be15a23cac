"""Options that several verbs share, and the place (library, templates, target) they name."""

import dataclasses
import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator.cli import completion
from mutator.engines.kinds import ENGINES, FORK

if TYPE_CHECKING:
    from mutator.workspace import Workspace

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Manifest = Annotated[
    str | None,
    typer.Option(
        help="Name or file of the target's manifest; default: the library's only one.",
        autocompletion=completion.targets,
    ),
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of drawn values and times.")]
Reading = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="A reading that the library declares; default: its first."),
]
Variant = Annotated[str | None, typer.Option(help="Only this variant of the spec.")]
Value = Annotated[float | None, typer.Option(help="This value (in the spec's unit) instead of drawn ones.")]
Run = Annotated[
    Path | None,
    typer.Option(
        "--run",
        metavar="DIR",
        help="The run folder; default: the newest in runs/.",
        autocompletion=completion.runs,
    ),
]
ExperimentId = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="Id of an experiment, or the start of one.",
        autocompletion=completion.experiments,
    ),
]
Only = Annotated[
    str | None,
    typer.Option(metavar="EXPR", help="Only experiments for which this holds, e.g. 'value > 100'."),
]
Exclude = Annotated[
    str | None, typer.Option(metavar="EXPR", help="Leave out experiments for which this holds.")
]
Limit = Annotated[
    int | None,
    typer.Option(
        min=1, help="At most so many experiments, spread over the plan, guided and random ones in pairs."
    ),
]
ShardOf = Annotated[
    str | None,
    typer.Option("--shard", metavar="K/N", help="Run the K-th of N shares of the plan; see `merge`."),
]
SeriesMb = Annotated[
    int | None,
    typer.Option(
        min=0,
        metavar="N",
        help="Keep at most so many MB of channels over time, those of the worst experiments first; 0: none. "
        "Default: 500.",
    ),
]
Engine = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="; ".join(f"{kind.name}: {kind.about}" for kind in ENGINES.values())
        + f". The results are the same. Default: {FORK}, where that is possible and worth it.",
    ),
]
AcceptVersions = Annotated[
    bool,
    typer.Option("--accept-versions", help="Other versions of Python or packages will do; they are noted."),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="WHERE",
        help="Have the workers of a Dask cluster do the work: a scheduler's address (tls://HOST:PORT), its "
        "scheduler file (FILE.json), local:N, or a cluster file (FILE.yaml).",
    ),
]
InsecureNetwork = Annotated[
    bool,
    typer.Option(
        "--insecure-network",
        help="Use a scheduler that others on the network can reach: they can run code on its workers.",
    ),
]
OutRun = Annotated[Path, typer.Option("--out", metavar="DIR", help="The run folder.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where library, templates and target are, as far as options say; the environment says the rest."""

    root: Path | None = None
    library: Path | None = None
    templates: Path | None = None
    target: Path | None = None

    def workspace(self) -> "Workspace":
        """The workspace found from here; MutatorError that tells how to name one."""
        return mutator.Workspace.find(self.root, self.library, self.templates, self.target)

    def over(self, other: "Place") -> "Place":
        """This place, its gaps filled from `other`."""
        mine = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return dataclasses.replace(other, **{k: v for k, v in mine.items() if v is not None})


Root = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder that holds fault_library/ and templates/ [env: MUTATOR_ROOT]."),
]
Library = Annotated[
    Path | None, typer.Option(metavar="DIR", help="The fault library [env: MUTATOR_LIBRARY].")
]
Templates = Annotated[
    Path | None, typer.Option(metavar="DIR", help="The fault models [env: MUTATOR_TEMPLATES].")
]
Target = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="The controller's source root, if not the manifest's [env: MUTATOR_TARGET]."
    ),
]
PLACE_OPTIONS = {"root": Root, "library": Library, "templates": Templates, "target": Target}


def with_place(verb: Callable[..., None]) -> Callable[..., None]:
    """Give a verb that takes `place` the four options that name one, before or after the verb's name."""
    signature = inspect.signature(verb, eval_str=True)
    own = [p for p in signature.parameters.values() if p.name != "place"]
    context = inspect.Parameter("ctx", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    extra = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)
        for name, annotation in PLACE_OPTIONS.items()
    ]

    @functools.wraps(verb)
    def run(*, ctx: typer.Context, **given: Any) -> None:
        place = Place(**{name: given.pop(name) for name in PLACE_OPTIONS})
        verb(place=place.over(ctx.obj or Place()), **given)

    own = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own]
    parameters = [context, *own, *extra]
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run
