"""`verify`: audit a run folder."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

import mutator
from mutator.cli import shell_completion
from mutator.cli.merge_report_clean_commands import workspace_if_any
from mutator.cli.shared_options import Json, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, error_text, short_path
from mutator.errors import EXIT_CHECK_FAILED


def register(app: typer.Typer) -> None:
    app.command("verify", epilog=EXAMPLES)(verify)
    app.command("seal", epilog=SEAL_EXAMPLES)(seal)


EXAMPLES = """\b
Examples:
  mutator verify runs/first
  mutator verify runs/first --rerun 5 --expect 3f9a...     (the seal that `mutator run` printed)
  mutator verify runs/first --signed-by allowed_signers --report
  mutator verify runs/first --repair
"""
SEAL_EXAMPLES = """\b
Examples:
  mutator seal runs/first
  mutator seal runs/first --sign ~/.ssh/id_ed25519
"""


@with_workspace_options
def verify(
    run: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="A run folder.", autocompletion=shell_completion.complete_runs),
    ],
    rerun: Annotated[int, typer.Option(metavar="N", min=0, help="Rerun N randomly drawn experiments.")] = 0,
    expect: Annotated[
        str | None,
        typer.Option(metavar="DIGEST", help="The expected seal, results or batches digest, 64 hex digits."),
    ] = None,
    expect_review: Annotated[
        str | None, typer.Option(metavar="DIGEST", help="The expected review digest, 64 hex digits.")
    ] = None,
    signed_by: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A file of allowed signers, one of whom must have signed the run."),
    ] = None,
    report: Annotated[
        bool, typer.Option("--report", help="Build the report again and compare it with the stored one.")
    ] = False,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair", help="Set damaged parts aside; `run` with the same folder then redoes them."
        ),
    ] = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Audit a run folder and print the result on one page.

    The exit code is 1 if anything was changed or does not follow from the plan and the sources.
    """
    terminal = Terminal(as_json)
    with terminal.show_spinner("verifying"):
        audit = mutator.verify(
            run,
            rerun=rerun,
            expect=expect,
            expect_review=expect_review,
            signed_by=signed_by,
            report=report,
            repair=repair,
            workspace=workspace_if_any(workspace_options),
        )
    if as_json:
        checks = [
            {
                "what": c.checked_parts,
                "count": c.checked_count,
                "differences": [error_text(d) for d in c.differences],
            }
            for c in audit.checks
        ]
        facts = {"run": str(run), "passed": audit.passed, **asdict(audit.seals), "facts": audit.facts}
        facts |= {"signer": audit.signer, "not_sealed": audit.not_sealed}
        terminal.print_json(facts | {"checks": checks, "repaired": audit.repaired})
    terminal.print_text(str(audit))
    if not audit.passed:
        raise typer.Exit(EXIT_CHECK_FAILED)


def seal(
    run: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="A run folder.", autocompletion=shell_completion.complete_runs),
    ],
    sign: Annotated[
        Path | None, typer.Option(metavar="KEY", help="The file of the SSH key to sign with.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Print the digests of a run, or sign them with an SSH key.

    The signature is stored in the run folder: seal.json and seal.json.sig. `verify --signed-by` checks it.
    """
    terminal = Terminal(as_json)
    with terminal.show_spinner("computing the digests"):
        seals = mutator.seal(run, sign=sign)
    if as_json:
        terminal.print_json({"run": str(run), "signed": sign is not None, **asdict(seals)})
    for name, value in seals.digest_by_name().items():
        terminal.print_text(f"{name}: {value}")
    if sign:
        terminal.print_text(f"signed: {short_path(run / 'seal.json.sig')}")
    elif not seals.seal:
        terminal.print_text("seal: none: the run is not finished")
