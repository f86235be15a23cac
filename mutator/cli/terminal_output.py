"""Output of the command line: Rich in a terminal, plain text in a pipe, JSON for programs.

Rich is imported late, so `--help` and shell completion stay fast.
"""

import codecs
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TextIO

from mutator._common import command_progress_events
from mutator._common.hashing import as_json_types
from mutator._common.message_text import NO_BREAK_SPACE, short_id_length, with_unbreakable_units, wrap_text
from mutator._common.table_rendering import TextTable
from mutator.cli.terminal_table_layout import TerminalTable
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import ProgressColumn

_CONTROL_PATTERN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # not tabs and new lines
PIPE_LINE_WIDTH = 100  # line width outside a terminal, unless COLUMNS is set

STYLE_BY_ENDING = {
    "ok": "green",
    "hazard": "bold red",
    "sdc": "yellow",
    "masked": "cyan",
    "not_activated": "dim",
    "not_judged": "dim",
    "left_out": "dim",
    "crashed": "magenta",
    "timeout": "magenta",
    "invalid_mutant": "bold magenta",
    "harness_error": "bold white on red",
}


# the consoles of progress bars; what is printed by the same console stands above its bar
_live_consoles: "list[Console]" = []


@dataclass
class Terminal:
    """Standard output and standard error of a command. With `as_json`, only `print_json` writes output; with
    `wide`, tables keep all columns and whole ids, as in a pipe.
    """

    as_json: bool = False
    wide: bool = False

    @cached_property
    def out(self) -> "Console":
        return _build_console(stderr=False)

    @cached_property
    def _own_err(self) -> "Console":
        return _build_console(stderr=True)

    @property
    def err(self) -> "Console":
        return _live_consoles[-1] if _live_consoles else self._own_err

    def print_text(self, text: str = "", style: str | None = None, *, without_folding: bool = False) -> None:
        """Print text; fold it unless `without_folding` is set, as for a command to copy."""
        if not self.as_json:
            _print_text(self.out, text, style, without_folding=without_folding)

    def print_result(self, text: str, style: str | None = None) -> None:
        """Print the sentence that says what came out of the command."""
        command_progress_events.report_result(text)
        self.print_text(text, style)

    def print_link(self, kind: str, path: Path, text: str | None = None) -> None:
        """Print where a file was written: `kind: path`, or `text`."""
        command_progress_events.report_written_file(kind, path)
        self.print_text(text or f"{kind}: {short_path(path)}")

    def print_note(self, text: str, *, without_folding: bool = False) -> None:
        """Print a remark to standard error, so that a pipe gets only the result."""
        with ignoring_stderr_errors():
            _print_text(self.err, text, "dim", without_folding=without_folding)

    def print_error(self, text: str) -> None:
        """Print an error to standard error."""
        command_progress_events.report_error(text)
        with ignoring_stderr_errors():
            _print_text(self.err, f"error: {text}", "bold red")

    def print_json(self, data: Any) -> None:
        """Print the result as one JSON document; infinity and NaN become null."""
        is_narrow = codecs.lookup(sys.stdout.encoding).name != "utf-8"  # other encodings lack characters
        json.dump(_as_json(data), sys.stdout, indent=2, ensure_ascii=is_narrow, allow_nan=False)
        sys.stdout.write("\n")

    def print_table(
        self,
        heads: Sequence[str],
        rows: Iterable[Sequence[object]],
        *,
        right_aligned: Sequence[int] = (),
        priorities: Sequence[int] = (),
        last_is_total: bool = False,
        last_is_whole: bool = False,
    ) -> None:
        """Print a table. Numbers of columns begin with 0; `last_is_total` sets the last row apart. With
        `last_is_whole`, cells of the last column are never folded, so that they can be copied.

        A terminal that is too narrow shows the columns in `priorities` first, then those from left to right.
        """
        cells = [[_cell_text(c) for c in row] for row in rows]
        if self.as_json:
            return
        if not self.out.is_terminal:
            self.print_text(
                TextTable(heads=heads, rows=cells, right_aligned=right_aligned).as_text(),
                without_folding=True,
            )
            return
        self._print_in_terminal(
            TerminalTable(
                heads=heads,
                rows=cells,
                right_aligned=right_aligned,
                priorities=priorities,
                last_is_total=last_is_total,
                last_is_whole=last_is_whole,
            )
        )

    def _print_in_terminal(self, table: TerminalTable) -> None:
        from rich.text import Text

        layout = table.layout(None if self.wide else self.out.width)
        rule = "-" if self.out.options.ascii_only else "─"
        for line in table.as_lines(layout, STYLE_BY_ENDING, rule):
            self.out.print(Text.assemble(*line), soft_wrap=True)
        if layout.dropped:
            names = "; ".join(table.heads[index] for index in layout.dropped)
            self.print_text(f"not shown: {names} (`--wide` shows all columns)", style="dim")

    def id_length(self, ids: Iterable[str]) -> int | None:
        """Return how many characters of each id to show: in a terminal 8, or as many as make it unique; else
        None, for all.
        """
        if self.as_json or self.wide or not self.out.is_terminal:
            return None
        return short_id_length(set(ids))

    def print_command(self, introduction: str, command: str) -> None:
        """Print a command to copy, which is never folded: behind its introduction, or on a line of its
        own if both do not fit.
        """
        if len(introduction) + 1 + len(command) <= _line_width(self.out):
            self.print_text(f"{introduction} {command}", without_folding=True)
            return
        self.print_text(introduction)
        self.print_text(f"  {command}", without_folding=True)

    def print_diff(self, patch: str) -> None:
        """Print a unified diff: coloured in a terminal, elsewhere unchanged. Its lines are never folded,
        because `patch` needs them whole.
        """
        if self.as_json:
            return
        if not self.out.is_terminal:
            sys.stdout.flush()  # text that was printed before must come first
            sys.stdout.buffer.write(patch.encode("utf-8", "surrogateescape"))
            sys.stdout.buffer.flush()
            return
        from rich.text import Text

        text = Text()
        for line in patch.splitlines():
            text.append(line + "\n", style=_diff_style(line))
        self.out.print(text, soft_wrap=True, end="")

    @contextmanager
    def show_bars(self, *columns: "ProgressColumn") -> "Iterator[Bars]":
        """Show progress bars on standard error; what is printed there in the meantime stands above them."""
        from rich.progress import Progress as Bars

        console = self.err
        with Bars(*columns, console=console, transient=True) as bars:
            _live_consoles.append(console)
            try:
                yield bars
            finally:
                _live_consoles.remove(console)

    @contextmanager
    def show_spinner(self, text: str) -> Iterator[None]:
        command_progress_events.report_phase(text)
        if self.as_json or not self.err.is_terminal:
            yield
            return
        from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with self.show_bars(*columns) as bars:
            bars.add_task(text, total=None)
            yield

    @contextmanager
    def show_count(self, total: int, label: str) -> Iterator[Callable[[], None]]:
        """Show a progress bar of `total` equal steps; yield the function to call after each step."""
        if self.as_json or not self.err.is_terminal:
            yield lambda: None
            return
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(compact=True),
        )
        with self.show_bars(*columns) as bars:
            task = bars.add_task(label, total=total)
            yield lambda: bars.advance(task)


# options whose name differs from the API's argument
_OPTION_BY_ARGUMENT = {
    "armed_after_s": "--armed-after",
    "gates": "--fail-on",
    "reviewed": "--require-reviewed",
    "specs": "SPEC",
    "shards": "DIR",
    "fault": "SPEC",
    "id": "EXPERIMENT",
    "target": "--manifest",
    "triggers": "--trigger",
    "scenarios": "--scenario",
    "starts": "--at",
}


def option_of_argument(argument: str) -> str:
    return _OPTION_BY_ARGUMENT.get(argument) or "--" + argument.replace("_", "-")


def with_option_names(
    error: MutatorError, command_options: Mapping[str, str] = MappingProxyType({})
) -> MutatorError:
    """Return the error with options instead of API arguments; `command_options` has options of a single
    command.
    """
    if error.argument is None:
        return error

    def option_name(argument: str) -> str:
        return command_options.get(argument) or option_of_argument(argument)

    remedy = error.remedy and re.sub(r"`([a-z_]+)`", lambda match: option_name(match[1]), error.remedy)
    place = error.where or option_name(error.argument)
    return MutatorError(error.got, where=place, line=error.line, expected=error.expected, remedy=remedy)


def show_error(error: MutatorError) -> None:
    terminal, error = Terminal(), with_option_names(error)
    place = short_path(error.where) + (f":{error.line}" if error.line is not None else "")
    terminal.print_error(f"{place}: {error.got}" if place else error.got)
    if error.expected:
        terminal.print_note(f"  expected: {error.expected}")
    if error.remedy:
        terminal.print_note(f"  to do: {error.remedy}")


def error_text(error: MutatorError) -> str:
    error = with_option_names(error)
    where = short_path(error.where) or None
    return str(
        MutatorError(error.got, where=where, line=error.line, expected=error.expected, remedy=error.remedy)
    )


def short_path(location: str | Path | None) -> str:
    """Return a path as the user would type it: relative if it lies below the current folder."""
    if not location:
        return ""
    path = Path(location)
    try:
        # not `.`, which says nothing in a message
        return str(path.relative_to(Path.cwd()) if path.is_absolute() and path != Path.cwd() else path)
    except ValueError:
        return str(location)


@contextmanager
def ignoring_stderr_errors() -> Iterator[None]:
    """Ignore failures to write to standard error: they must not stop a command."""
    try:
        yield
    except OSError:
        discard_output(sys.stderr)


def discard_output(stream: TextIO) -> None:
    """Drop what is buffered in a standard stream and everything written to it later."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())  # closing it would give its number to the next file
    os.close(nowhere)


def _build_console(*, stderr: bool) -> "Console":
    from rich.console import Console

    class Piped(Console):
        """A console that raises BrokenPipeError instead of exiting with 1."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return Piped(stderr=stderr, highlight=False, emoji=False)  # keep `:x:` as text


def _print_text(console: "Console", text: str, style: str | None, *, without_folding: bool = False) -> None:
    text = _escape_controls(text)
    if not without_folding:
        text = wrap_text(with_unbreakable_units(text), _line_width(console))
    # Rich must not fold again
    console.print(
        text.replace(NO_BREAK_SPACE, " "), style=style, markup=False, highlight=False, soft_wrap=True
    )


def _line_width(console: "Console") -> int:
    """Return the width of the terminal; in a pipe, that of COLUMNS, or else `PIPE_LINE_WIDTH`."""
    if console.is_terminal:
        return console.width
    columns = os.environ.get("COLUMNS", "")
    return int(columns) if columns.isdecimal() and int(columns) else PIPE_LINE_WIDTH


def _cell_text(value: object) -> str:
    return "" if value is None else _escape_controls(str(value))


def _escape_controls(text: str) -> str:
    """Escape what controls a terminal; texts can come from somebody else's run folder."""
    return _CONTROL_PATTERN.sub(lambda match: repr(match[0])[1:-1], text)


def _as_json(value: Any) -> Any:
    value = as_json_types(value)
    if isinstance(value, dict):
        return {k: _as_json(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_as_json(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def _diff_style(line: str) -> str:
    if line.startswith(("+++", "---", "diff ", "index ", "new file")):
        return "bold"
    if line.startswith("@@"):
        return "cyan"
    if line.startswith("+"):
        return "green"
    return "red" if line.startswith("-") else ""
