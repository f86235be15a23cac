"""`doctor`: can this machine run campaigns?"""

import typer

from mutator.cli.console import Terminal
from mutator.cli.options import Json, Place, with_place
from mutator.errors import EXIT_CHECK_FAILED, MutatorError


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("doctor")(doctor)


@with_place
def doctor(as_json: Json = False, *, place: Place) -> None:
    """Can this machine run campaigns?

    Looks at interpreter, packages, machine, library and target; exit code 1 if a campaign could not run.
    """
    from mutator.doctor import Level, examine

    terminal = Terminal(as_json)
    with terminal.wait("looking around"):
        try:
            findings = examine(place.workspace())
        except MutatorError as e:
            findings = examine(e)
    if as_json:
        terminal.emit(findings)
    terminal.table(
        ["what", "state", "found", "to do"], [(f.name, f.level.value, f.found, f.remedy) for f in findings]
    )
    bad = [f.name for f in findings if f.level is Level.FAIL]
    if bad:
        terminal.say(f"not ready: {', '.join(bad)}", style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    terminal.say("ready", style="green")
