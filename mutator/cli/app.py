"""The program `mutator`: collects the subcommands and reports errors."""

import errno
import io
import os
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Annotated, Any

import typer
from typer.core import TyperGroup
from typer.main import get_command

from mutator._common import progress_events
from mutator._common.files import disk_full_error, is_disk_full_error
from mutator._common.interrupts import interruptible
from mutator._common.resource_shortages import find_shortage
from mutator._common.version import VERSION
from mutator.cli import (
    audits,
    caches,
    campaigns,
    comparisons,
    experiments,
    exports,
    faults,
    hazard_analysis,
    library,
    new_library,
    places,
    reviews,
    run_folders,
    serving,
)
from mutator.cli.console import Terminal, discard, remarking, show_error
from mutator.cli.options import Library, Place, Root, Sandbox, Target, Templates
from mutator.errors import (
    EXIT_CHECK_FAILED,
    EXIT_HARNESS_ERRORS,
    EXIT_OK,
    EXIT_WRONG_INPUT,
    MutatorError,
    MutatorWarning,
)

EXIT_INTERRUPTED = 130
EXIT_CODES = {
    EXIT_OK: "success",
    EXIT_CHECK_FAILED: "a check failed",
    EXIT_WRONG_INPUT: "wrong input",
    EXIT_HARNESS_ERRORS: "harness errors or unfinished experiments",
    EXIT_INTERRUPTED: "interrupted",
}
THE_MACHINE_SAYS_NO = {errno.EACCES, errno.EPERM, errno.EROFS}

GROUPS = (
    ("Look around", ("list", "places", "init", "stpa", "check", "doctor", "cache")),
    ("One fault", ("try", "diff", "generate")),
    ("Before a campaign", ("review",)),
    ("Campaigns", ("plan", "run", "merge", "report", "clean")),
    ("After a campaign", ("compare", "export", "verify", "seal")),
    ("One experiment", ("show", "rerun")),
    ("In a browser", ("serve",)),
)
EXAMPLES = f"""\b
Examples:
  mutator list                                    show what the library contains
  mutator try radar/chaff --scenario S1           try one fault: diff, verdict, plot
  mutator run quickstart --out runs/first         run or resume a campaign
  mutator show 3f9a                               show one experiment by the start of its id

\b
Exit codes: {", ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items())}.
mutator looks for the library, templates and target in this order: options (before or after the command),
environment variables, the nearest parent folder with a fault_library/, the copies that ship with mutator.
"""


class Verbs(TyperGroup):
    """The subcommands, grouped by purpose in the help."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for title, names in GROUPS:
            rows = [(name, self.commands[name].get_short_help_str(90)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows, col_max=12)


app = typer.Typer(
    cls=Verbs,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    epilog=EXAMPLES,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mutator {VERSION}")
        raise typer.Exit


@app.callback()
def start(
    ctx: typer.Context,
    root: Root = None,
    library: Library = None,
    templates: Templates = None,
    target: Target = None,
    sandbox: Sandbox = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Inject faults into a driving controller, simulate it, and see the effects."""
    ctx.obj = Place(root=root, library=library, templates=templates, target=target, sandbox=sandbox)


for module in (
    library,
    new_library,
    hazard_analysis,
    places,
    faults,
    reviews,
    campaigns,
    run_folders,
    audits,
    comparisons,
    exports,
    experiments,
    serving,
    caches,
):
    module.register(app)


def program() -> int:
    """Run `mutator`. If experiments are left unfinished, end the process without the interpreter's cleanup,
    which can crash after memory has run out.
    """
    code = main()
    if code == EXIT_HARNESS_ERRORS:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    _open_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # as standard error does by default
    try:
        code = _answer(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()  # at exit, the interpreter would report a closed pipe as an error
    except BrokenPipeError:  # the reader has closed the pipe
        discard(sys.stdout)
        return EXIT_OK
    return code


def _open_streams() -> None:
    """Replace closed standard streams with null devices. Otherwise a file opened later could get the number
    of a standard stream, and its output.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            file = os.open(os.devnull, os.O_RDWR)
            if file != number:
                os.dup2(file, number)
                os.close(file)
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


@cache
def _command() -> Any:
    """Return the program with its subcommands, whose options take long to collect."""
    return get_command(app)


def _answer(words: Sequence[str]) -> int:
    try:
        progress_events.open_events()
        # Not `app()`, which has its own handling of errors, interrupts and closed pipes.
        command = _command()
        if "_MUTATOR_COMPLETE" in os.environ:  # a shell asks for completions
            command.main(prog_name="mutator")
        with (
            _warnings_in_one_line(),
            interruptible(),
            command.make_context("mutator", [*words] or ["--help"]) as ctx,
        ):
            command.invoke(ctx)
        return EXIT_OK
    except typer.Exit as e:
        return e.exit_code
    except SystemExit as e:  # raised by shell completion
        return int(e.code or 0)
    except MutatorError as e:
        show_error(e)
        return e.exit_code
    except typer.TyperException as e:
        return _usage(e)
    except (typer.Abort, KeyboardInterrupt) as e:
        _say(str(e) or "interrupted")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        raise
    except Exception as e:
        if (known := _known(e)) is None:
            return _defect()
        show_error(known)
        return known.exit_code


def _known(error: Exception) -> MutatorError | None:
    """Return a MutatorError for an error that the user can fix on the machine, or None."""
    where = getattr(error, "filename", None)
    if is_disk_full_error(error):
        return disk_full_error(where)
    if short := find_shortage(error):
        return short
    if isinstance(error, UnicodeEncodeError) and isinstance(error.object, str):
        return _no_text(error.object[error.start : error.end])
    if isinstance(error, OSError) and error.errno in THE_MACHINE_SAYS_NO:
        return MutatorError(str(error.strerror), where=where, remedy="choose another folder")
    return None


def _no_text(characters: str) -> MutatorError:
    return MutatorError(
        f"{characters!a} cannot be encoded in this environment",
        expected="names in UTF-8 and a UTF-8 locale",
        remedy="set LC_ALL=C.UTF-8 or PYTHONUTF8=1, or use other names",
    )


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    with warnings.catch_warnings():
        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, MutatorWarning):
                progress_events.report_warning(str(message))
                Terminal().note(f"warning: {message}")
            else:
                others(message, category, *place, **more)

        warnings.simplefilter("always", MutatorWarning)
        warnings.showwarning = show
        yield


def _usage(error: typer.TyperException) -> int:
    ctx = getattr(error, "ctx", None)
    remedy = f"see `{ctx.command_path} --help`" if ctx else "see `mutator --help`"
    message = error.format_message().rstrip(".").replace("Value error, ", "")
    if message:
        show_error(MutatorError(message, remedy=remedy))
    return EXIT_WRONG_INPUT


def _defect() -> int:
    _say(traceback.format_exc().rstrip())
    _say("this is a bug in mutator, not in your input; please report it together with the lines above")
    return EXIT_HARNESS_ERRORS


def _say(text: str) -> None:
    progress_events.report_error(text)
    with remarking():
        print(text, file=sys.stderr)


if __name__ == "__main__":
    raise SystemExit(main())
