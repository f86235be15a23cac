"""Options that several subcommands share, and those that say where the library, templates and target are."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator.cli import shell_completion
from mutator.engines.engine_kinds import ENGINES, FORK, OFFERED_ENGINES

if TYPE_CHECKING:
    from mutator.workspace import Workspace

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
Wide = Annotated[
    bool,
    typer.Option(
        "--wide", help="In a terminal: show all columns of tables and whole ids, even if lines get too long."
    ),
]
Manifest = Annotated[
    str | None,
    typer.Option(
        help="Name or file of the target's manifest. Default: the library's only manifest.",
        autocompletion=shell_completion.complete_targets,
    ),
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed for drawn values and times.")]
Reading = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="One of the library's readings. Default: the first."),
]
Variant = Annotated[str | None, typer.Option(help="Only this variant of the spec.")]
Value = Annotated[
    float | None, typer.Option(help="Use this value, in the spec's unit, instead of drawn ones.")
]
RunFolderOption = Annotated[
    Path | None,
    typer.Option(
        "--run",
        metavar="DIR",
        help="The run folder. Default: the newest in runs/.",
        autocompletion=shell_completion.complete_runs,
    ),
]
ExperimentId = Annotated[
    str,
    typer.Argument(
        metavar="EXPERIMENT",
        help="An experiment's id, or the start of the id.",
        autocompletion=shell_completion.complete_experiments,
    ),
]
Only = Annotated[
    str | None,
    typer.Option(
        metavar="EXPR",
        help="Only experiments that match, e.g. 'value > 100'.",
        autocompletion=shell_completion.complete_plan_columns,
    ),
]
Exclude = Annotated[
    str | None,
    typer.Option(
        metavar="EXPR",
        help="Leave out experiments that match.",
        autocompletion=shell_completion.complete_plan_columns,
    ),
]
Limit = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="At most this many experiments, for a quick look: each variant equally often, guided and random "
        "ones in pairs.",
    ),
]
Proportional = Annotated[
    bool,
    typer.Option(
        "--proportional",
        help="With --limit: keep each fault type in each scenario in proportion to its number of experiments "
        "(at least one pair), so that rates estimate those of the whole plan.",
    ),
]
Shard = Annotated[
    str | None,
    typer.Option("--shard", metavar="K/N", help="Run shard K of N; see `merge`."),
]
SeriesMb = Annotated[
    int | None,
    typer.Option(
        min=0,
        metavar="N",
        help="Keep at most this many MB of series (channels over time), worst experiments first; 0: none. "
        "Default: 500.",
    ),
]
Engine = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="; ".join(f"{kind.name}: {kind.about}" for kind in map(ENGINES.__getitem__, OFFERED_ENGINES))
        + f". All give the same results. Default: {FORK}, where possible and worthwhile.",
        autocompletion=shell_completion.complete_engines,
    ),
]
AcceptVersions = Annotated[
    bool,
    typer.Option("--accept-versions", help="Accept other versions of Python or packages, and record them."),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="WHERE",
        help="Use the workers of a Dask cluster: the scheduler's address (tls://HOST:PORT), its scheduler "
        "file (FILE.json), local:N, or a cluster file (FILE.yaml).",
    ),
]
InsecureNetwork = Annotated[
    bool,
    typer.Option(
        "--insecure-network",
        help="Accept a scheduler that others on the network can reach: they can run code on its workers.",
    ),
]
OutRunFolder = Annotated[Path, typer.Option("--out", metavar="DIR", help="The run folder.")]


Root = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Folder with fault_library/ and templates/ [env: MUTATOR_ROOT]."),
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
        metavar="DIR", help="The controller's source root. Default: the manifest's [env: MUTATOR_TARGET]."
    ),
]
Sandbox = Annotated[
    bool | None,
    typer.Option(
        "--sandbox",
        help="Run the target's code in a sandbox, without your files and the network (needs bubblewrap).",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkspaceOptions:
    """The library, templates and target that options name; the environment supplies the rest.

    `sandbox` is whether the target's code runs in a sandbox.
    """

    root: Root = None
    library: Library = None
    templates: Templates = None
    target: Target = None
    sandbox: Sandbox = None

    def workspace(self) -> "Workspace":
        sandbox = bool(self.sandbox)
        return mutator.Workspace.find(self.root, self.library, self.templates, self.target, sandbox=sandbox)

    def with_defaults(self, defaults: "WorkspaceOptions") -> "WorkspaceOptions":
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(defaults, **{k: v for k, v in values.items() if v is not None})


def with_workspace_options(verb: Callable[..., None]) -> Callable[..., None]:
    """Replace each parameter that is a dataclass of options by these options, as Typer needs them.

    Options of the workspace can also stand before the subcommand; those after it win.
    """
    signature = inspect.signature(verb, eval_str=True)
    class_by_parameter: dict[str, Any] = {
        p.name: p.annotation for p in signature.parameters.values() if is_dataclass(p.annotation)
    }
    context = inspect.Parameter("ctx", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context)
    parameters = [context]
    for parameter in signature.parameters.values():
        option_signature = (
            inspect.signature(class_by_parameter[parameter.name])
            if parameter.name in class_by_parameter
            else None
        )
        replacements = option_signature.parameters.values() if option_signature else [parameter]
        # keyword-only parameters can have defaults in any order
        parameters += [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in replacements]

    @functools.wraps(verb)
    def run_verb(*, ctx: typer.Context, **values: Any) -> None:
        for name, options_class in class_by_parameter.items():
            values[name] = options_class(
                **{field.name: values.pop(field.name) for field in fields(options_class)}
            )
        # `ctx.obj` has the options before the subcommand
        workspace_options = values.pop("workspace_options").with_defaults(ctx.obj or WorkspaceOptions())
        verb(workspace_options=workspace_options, **values)

    # Typer reads both the signature and the annotations
    run_verb.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run_verb.__annotations__ = {p.name: p.annotation for p in parameters}
    return run_verb
