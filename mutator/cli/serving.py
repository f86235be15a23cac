"""`serve`: reports, reviews and jobs in a browser."""

import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from mutator.cli import completion
from mutator.cli.console import Terminal
from mutator.cli.options import Place, with_place
from mutator.errors import MutatorError

EXAMPLES = """\b
Examples:
  mutator serve                          the runs in runs/, and the library's reviews
  mutator serve runs/first /data/night --port 8123
  mutator serve --no-browser             where there is none: open the printed address

Only this machine can reach it, and only with the address that it prints. Ctrl-C ends it, and its jobs.
"""


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("serve", epilog=EXAMPLES)(serve)


@with_place
def serve(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RUNS",
            help="Run folders, or folders of them; default: runs/.",
            autocompletion=completion.runs,
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0: any that is free.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, max=16, help="So many jobs at a time.")] = 1,
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
    *,
    place: Place,
) -> None:
    """Show reports, review mutants, start jobs, in a browser."""
    if not all(map(find_spec, ("starlette", "uvicorn"))):
        raise MutatorError(
            "no server is installed", expected="the extra `serve`", remedy="pip install 'mutator[serve]'"
        )
    from mutator.api.serving import serve_runs

    terminal = Terminal()

    def ready(address: str) -> None:
        terminal.say(address, whole=True)
        terminal.note("Ctrl-C ends the server")
        if browser:
            webbrowser.open(address)

    try:
        serve_runs(runs or (), port=port, at_once=jobs, ready=ready, workspace=place.workspace())
    except KeyboardInterrupt:  # that is how one ends it
        terminal.note("ended")
