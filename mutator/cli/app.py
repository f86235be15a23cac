"""The program `mutator`: collects the subcommands and reports errors."""

import errno
import io
import os
import re
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

from mutator._common import command_progress_events
from mutator._common.files import disk_full_error, is_disk_full_error
from mutator._common.interrupts import raising_keyboard_interrupts
from mutator._common.message_text import spelling_suggestion
from mutator._common.resource_shortages import find_shortage
from mutator._common.version import VERSION
from mutator.cli import (
    cache_command,
    compare_command,
    envelope_and_search_commands,
    export_command,
    import_command,
    init_command,
    list_check_doctor_commands,
    merge_report_clean_commands,
    places_command,
    plan_and_run_commands,
    review_command,
    serve_command,
    show_and_rerun_commands,
    shrink_command,
    stpa_command,
    try_diff_generate_commands,
    verify_and_seal_commands,
    watch_command,
)
from mutator.cli.shared_options import Library, Root, Sandbox, Target, Templates, WorkspaceOptions
from mutator.cli.subcommand_help import NamedValuesCommand
from mutator.cli.terminal_output import Terminal, discard_output, ignoring_stderr_errors, show_error
from mutator.errors import (
    EXIT_CHECK_FAILED,
    EXIT_HARNESS_ERRORS,
    EXIT_OK,
    EXIT_WRONG_INPUT,
    MutatorError,
    MutatorWarning,
)

EXIT_INTERRUPTED = 130  # 128 + SIGINT, as in a shell
EXIT_CODES = {
    EXIT_OK: "success",
    EXIT_CHECK_FAILED: "a check failed",
    EXIT_WRONG_INPUT: "wrong input",
    EXIT_HARNESS_ERRORS: "harness errors or unfinished experiments",
    EXIT_INTERRUPTED: "interrupted",
}
# another folder helps; any other OSError is a defect
_PERMISSION_ERRORS = {errno.EACCES, errno.EPERM, errno.EROFS}

SUBCOMMAND_GROUPS = (
    ("Look around", ("list", "places", "init", "import", "stpa", "check", "doctor", "cache")),
    ("One fault", ("try", "diff", "generate")),
    ("Before a campaign", ("review",)),
    ("How much is survived", ("envelope", "search")),
    ("Campaigns", ("plan", "run", "watch", "merge", "report", "clean")),
    ("After a campaign", ("compare", "export", "verify", "seal")),
    ("One experiment", ("show", "rerun", "shrink")),
    ("In a browser", ("serve",)),
)
EXAMPLES = f"""\b
Examples:
  mutator list                                    show what the library contains
  mutator try radar/chaff --scenario S1           try one fault: diff and verdict
  mutator run quickstart --out runs/first         run or resume a campaign
  mutator show 3f9a                               show one experiment by the start of its id

\b
Exit codes: {", ".join(f"{code} {meaning}" for code, meaning in EXIT_CODES.items())}.
mutator looks for the library, templates and target in this order: options (before or after the command),
environment variables, the nearest parent folder with a fault_library/, the copies that ship with mutator.
"""


_WRONG_CHOICE_PATTERN = re.compile(r"'([^']*)' is not one of (.*)", re.DOTALL)  # in Typer's message


class GroupedSubcommands(TyperGroup):
    """The subcommands, grouped by purpose in the help."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        for title, names in SUBCOMMAND_GROUPS:
            rows = [(name, self.commands[name].get_short_help_str(90)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows, col_max=12)


app = typer.Typer(
    cls=GroupedSubcommands,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,  # `_report_defect` shows tracebacks
    epilog=EXAMPLES,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        typer.echo(f"mutator {VERSION}")
        raise typer.Exit


@app.callback()
def store_workspace_options(
    ctx: typer.Context,
    root: Root = None,
    library: Library = None,
    templates: Templates = None,
    target: Target = None,
    sandbox: Sandbox = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Inject faults into a driving controller, simulate it, and see the effects."""
    ctx.obj = WorkspaceOptions(
        root=root, library=library, templates=templates, target=target, sandbox=sandbox
    )


for module in (
    list_check_doctor_commands,
    init_command,
    import_command,
    stpa_command,
    places_command,
    try_diff_generate_commands,
    review_command,
    plan_and_run_commands,
    watch_command,
    merge_report_clean_commands,
    verify_and_seal_commands,
    compare_command,
    envelope_and_search_commands,
    export_command,
    show_and_rerun_commands,
    shrink_command,
    serve_command,
    cache_command,
):
    module.register(app)
for subcommand in app.registered_commands:
    subcommand.cls = NamedValuesCommand


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
        code = _run_command_line(sys.argv[1:] if argv is None else argv)
        sys.stdout.flush()  # at exit, the interpreter would report a closed pipe as an error
    except BrokenPipeError:  # the reader has closed the pipe
        discard_output(sys.stdout)
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
            os.set_inheritable(number, True)  # child processes need open streams as well
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))


@cache
def _click_command() -> Any:
    """Return the program with its subcommands, whose options take long to collect."""
    return get_command(app)


def _run_command_line(argv: Sequence[str]) -> int:
    try:
        command_progress_events.open_events_pipe()
        # Not `app()`, which has its own handling of errors, interrupts and closed pipes.
        command = _click_command()
        if "_MUTATOR_COMPLETE" in os.environ:  # a shell asks for completions
            command.main(prog_name="mutator")
        with (
            _warnings_in_one_line(),
            raising_keyboard_interrupts(),
            command.make_context("mutator", [*argv] or ["--help"]) as ctx,
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
        return _report_usage_error(e)
    except (typer.Abort, KeyboardInterrupt) as e:
        _print_error(str(e) or "interrupted")
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # no defect: `main` ends quietly
        raise
    except Exception as e:
        if (machine_error := _machine_error(e)) is None:
            return _report_defect()
        show_error(machine_error)
        return machine_error.exit_code


def _machine_error(error: Exception) -> MutatorError | None:
    """Return a MutatorError for an error that the user can fix on the machine, or None."""
    where = getattr(error, "filename", None)
    if is_disk_full_error(error):
        return disk_full_error(where)
    if short := find_shortage(error):
        return short
    if isinstance(error, UnicodeEncodeError) and isinstance(error.object, str):
        return _encoding_error(error.object[error.start : error.end])
    if isinstance(error, OSError) and error.errno in _PERMISSION_ERRORS:
        return MutatorError(str(error.strerror), where=where, remedy="choose another folder")
    return None


def _encoding_error(characters: str) -> MutatorError:
    return MutatorError(
        f"{characters!a} cannot be encoded in this environment",
        expected="names in UTF-8 and a UTF-8 locale",
        remedy="set LC_ALL=C.UTF-8 or PYTHONUTF8=1, or use other names",
    )


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    with warnings.catch_warnings():
        show_other_warning = warnings.showwarning
        shown_texts: set[str] = set()

        def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
            if issubclass(category, MutatorWarning):
                if str(message) in shown_texts:
                    return
                shown_texts.add(str(message))
                command_progress_events.report_warning(str(message))
                Terminal().print_note(f"warning: {message}")
            else:
                show_other_warning(message, category, *place, **more)

        warnings.simplefilter("always", MutatorWarning)  # by default, Python shows a repeated warning once
        warnings.showwarning = show
        yield


def _report_usage_error(error: typer.TyperException) -> int:
    ctx = getattr(error, "ctx", None)
    remedy = f"see `{ctx.command_path} --help`" if ctx else "see `mutator --help`"
    # a prefix that Pydantic adds
    message = error.format_message().rstrip(".").replace("Value error, ", "")
    if choice := _WRONG_CHOICE_PATTERN.search(message):
        remedy += spelling_suggestion(choice[1], re.findall(r"'([^']*)'", choice[2]))
    if message:
        show_error(MutatorError(message, remedy=remedy))
    return EXIT_WRONG_INPUT


def _report_defect() -> int:
    _print_error(traceback.format_exc().rstrip())
    _print_error(
        "this is a bug in mutator, not in your input; please report it together with the lines above"
    )
    return EXIT_HARNESS_ERRORS


def _print_error(text: str) -> None:
    command_progress_events.report_error(text)
    with ignoring_stderr_errors():
        print(text, file=sys.stderr)


if __name__ == "__main__":
    raise SystemExit(main())
