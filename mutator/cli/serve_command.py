"""`serve`: reports, reviews and jobs in a browser."""

import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from mutator._common.version import extra_install_command
from mutator.cli import shell_completion
from mutator.cli.shared_options import WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal
from mutator.errors import MutatorError

EXAMPLES = """\b
Examples:
  mutator serve                          the runs in runs/, and the library's reviews
  mutator serve runs/first /data/night --port 8123
  mutator serve --no-browser             only print the address to open

The server accepts connections only from this machine, and only with the printed address. Ctrl-C stops the
server and its jobs.
"""


def register(app: typer.Typer) -> None:
    app.command("serve", epilog=EXAMPLES)(serve)


@with_workspace_options
def serve(
    runs: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RUNS",
            help="Run folders, or folders of run folders. Default: runs/.",
            autocompletion=shell_completion.complete_runs,
        ),
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0: any free port.")] = 0,
    jobs: Annotated[int, typer.Option(min=1, max=16, help="Number of jobs at a time.")] = 1,
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show reports, review mutants and start jobs in a browser."""
    if not all(map(find_spec, ("starlette", "uvicorn"))):
        raise MutatorError(
            "the server is not installed", expected="the extra `serve`", remedy=extra_install_command("serve")
        )
    from mutator.api.serving import serve_runs

    terminal = Terminal()

    def ready(address: str) -> None:
        terminal.print_text(address, without_folding=True)
        terminal.print_note("Ctrl-C stops the server")
        if browser:
            webbrowser.open(address)

    try:
        serve_runs(
            runs or (),
            port=port,
            most_parallel_jobs=jobs,
            on_ready=ready,
            workspace=workspace_options.workspace(),
        )
    except KeyboardInterrupt:
        terminal.print_note("stopped")
