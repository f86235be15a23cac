"""How the command line speaks: Rich in a terminal, plain text in a pipe, JSON where a program reads.

Rich is imported when the first line is printed, so `--help` and shell completion do not pay for it.
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

from mutator._common.hashing import plain
from mutator._common.tables import Table
from mutator._common.text import folded
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable

PIPE_COLUMNS = 100  # of lines that no terminal shows, unless COLUMNS says otherwise

STYLES = {
    "ok": "green",
    "hazard": "bold red",
    "sdc": "yellow",
    "masked": "cyan",
    "not_activated": "dim",
    "crashed": "magenta",
    "timeout": "magenta",
    "invalid_mutant": "bold magenta",
    "harness_error": "bold white on red",
}


@dataclass
class Terminal:
    """Standard output and standard error of one command. With `as_json` only `emit` writes to the output."""

    as_json: bool = False

    @cached_property
    def out(self) -> "Console":
        return _console(stderr=False)

    @cached_property
    def err(self) -> "Console":
        return _console(stderr=True)

    def say(self, text: str = "", style: str | None = None, *, whole: bool = False) -> None:
        """Lines of text, folded; `whole`: as they are, as of a command that one copies."""
        if not self.as_json:
            _print(self.out, text, style, whole=whole)

    def note(self, text: str) -> None:
        """A remark beside the result: to standard error, so that a pipe gets the result alone."""
        with remarking():
            _print(self.err, text, "dim")

    def complain(self, text: str) -> None:
        """What went wrong, to standard error."""
        with remarking():
            _print(self.err, f"error: {text}", "bold red")

    def emit(self, data: Any) -> None:
        """The result as one JSON document; numbers JSON does not know (infinity, nan) become null."""
        is_narrow = codecs.lookup(sys.stdout.encoding).name != "utf-8"
        json.dump(_jsonable(data), sys.stdout, indent=2, ensure_ascii=is_narrow, allow_nan=False)
        sys.stdout.write("\n")

    def table(
        self,
        heads: Sequence[str],
        rows: Iterable[Sequence[object]],
        *,
        right: Sequence[int] = (),
        total: bool = False,
    ) -> None:
        """A table; columns in `right` are numbers; with `total` the last row is set apart."""
        cells = [[_cell(c) for c in row] for row in rows]
        if self.as_json:
            return
        if self.out.is_terminal:
            self.out.print(_rich_table(heads, cells, right, total))
        else:
            self.say(Table(heads=heads, rows=cells, right=right).as_text(), whole=True)

    def diff(self, patch: str) -> None:
        """A unified diff, coloured in a terminal; elsewhere its very bytes, for `patch`."""
        if self.as_json:
            return
        if not self.out.is_terminal:
            sys.stdout.flush()
            sys.stdout.buffer.write(patch.encode("utf-8", "surrogateescape"))
            sys.stdout.buffer.flush()
            return
        from rich.text import Text

        text = Text()
        for line in patch.splitlines():
            text.append(line + "\n", style=_diff_style(line))
        self.out.print(text, soft_wrap=True, end="")

    @contextmanager
    def wait(self, text: str) -> Iterator[None]:
        """Tell that something takes a moment, and for how long by now."""
        if self.as_json or not self.err.is_terminal:
            yield
            return
        from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with Progress(*columns, console=self.err, transient=True) as progress:
            progress.add_task(text, total=None)
            yield

    @contextmanager
    def count(self, total: int, what: str) -> Iterator[Callable[[], None]]:
        """A progress bar over `total` equal steps; yields what to call after each."""
        if self.as_json or not self.err.is_terminal:
            yield lambda: None
            return
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(compact=True),
        )
        with Progress(*columns, console=self.err, transient=True) as progress:
            task = progress.add_task(what, total=total)
            yield lambda: progress.advance(task)


# options that are not named like the argument of the API that they stand for
_OPTIONS = {
    "armed_after_s": "--armed-after",
    "gates": "--fail-on",
    "reviewed": "--require-reviewed",
    "specs": "SPEC",
    "shards": "DIR",
    "fault": "SPEC",
    "id": "EXPERIMENT",
    "target": "--manifest",
    "triggers": "--trigger",
}


def option(argument: str) -> str:
    """The option of the command line that stands for an argument of the API."""
    return _OPTIONS.get(argument) or "--" + argument.replace("_", "-")


def with_options(error: MutatorError, own: Mapping[str, str] = MappingProxyType({})) -> MutatorError:
    """The error as the command line says it: options where the API names its arguments; `own` are those that
    the command names in its own way."""
    if error.argument is None:
        return error

    def named(argument: str) -> str:
        return own.get(argument) or option(argument)

    remedy = error.remedy and re.sub(r"`([a-z_]+)`", lambda found: named(found[1]), error.remedy)
    place = error.where or named(error.argument)
    return MutatorError(error.got, where=place, line=error.line, expected=error.expected, remedy=remedy)


def show_error(error: MutatorError) -> None:
    """An error of the user's, in one piece: place, what was got, expected, what to do."""
    terminal, error = Terminal(), with_options(error)
    place = short_path(error.where) + (f":{error.line}" if error.line is not None else "")
    terminal.complain(f"{place}: {error.got}" if place else error.got)
    if error.expected:
        terminal.note(f"  expected: {error.expected}")
    if error.remedy:
        terminal.note(f"  to do: {error.remedy}")


def error_text(error: MutatorError) -> str:
    """An error as one of several: one line, its file as the user would type it."""
    error = with_options(error)
    where = short_path(error.where) or None
    return str(
        MutatorError(error.got, where=where, line=error.line, expected=error.expected, remedy=error.remedy)
    )


def _rich_table(
    heads: Sequence[str], rows: list[list[str]], right: Sequence[int], total: bool
) -> "RichTable":
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text

    table = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False, header_style="bold")
    for i, head in enumerate(heads):
        table.add_column(Text(head), justify="right" if i in right else "left", overflow="fold")
    for i, row in enumerate(rows):
        last = total and i == len(rows) - 1
        if last:
            table.add_section()
        table.add_row(*(Text(c, style=STYLES.get(c, "bold" if last else "")) for c in row))
    return table


def short_path(where: str | Path | None) -> str:
    """A path as the user would type it: relative when it lies below the current folder."""
    if not where:
        return ""
    path = Path(where)
    try:
        return str(path.relative_to(Path.cwd()) if path.is_absolute() and path != Path.cwd() else path)
    except ValueError:
        return str(where)


@contextmanager
def remarking() -> Iterator[None]:
    """Within it, standard error is written to. That nobody can read it is no reason to stop a command."""
    try:
        yield
    except OSError:
        discard(sys.stderr)


def discard(stream: TextIO) -> None:
    """Drop what is still buffered in a standard stream, and all that will be written to it."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def _console(*, stderr: bool) -> "Console":
    from rich.console import Console

    class Piped(Console):
        """Says when nobody reads any more, as other files do, instead of leaving with 1."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return Piped(stderr=stderr, highlight=False, emoji=False)  # `:x:` in a text is no picture


def _print(console: "Console", text: str, style: str | None, *, whole: bool = False) -> None:
    """Print text without markup, folded unless it stays `whole`."""
    if not whole:
        text = folded(text, console.width if console.is_terminal else _columns())
    console.print(text, style=style, markup=False, highlight=False, soft_wrap=True)


def _columns() -> int:
    """How wide a line is that goes into a pipe or a file."""
    told = os.environ.get("COLUMNS", "")
    return int(told) if told.isdecimal() and int(told) else PIPE_COLUMNS


def _cell(value: object) -> str:
    return "" if value is None else str(value)


def _jsonable(value: Any) -> Any:
    value = plain(value)
    if isinstance(value, dict):
        return {k: _jsonable(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_jsonable(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def _diff_style(line: str) -> str:
    """Rich style of one line of a unified diff."""
    if line.startswith(("+++", "---", "diff ", "index ", "new file")):
        return "bold"
    if line.startswith("@@"):
        return "cyan"
    if line.startswith("+"):
        return "green"
    return "red" if line.startswith("-") else ""
