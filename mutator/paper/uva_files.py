"""Read the fault files of the paper's authors (UVA-DSA/OpenpilotWithVision and UVA-DSA/openpilot).

A file `scenario_<n>.txt` has a title that ends in the hazard, a line with the source file and the hook
comment after which faults were inserted, one line for each fault, and their number. Everything is parsed as
data.
"""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_path_inside
from mutator._common.message_text import counted, shortened_repr
from mutator.errors import MutatorError

LIBRARY_FOLDER = "fault_library"  # of the authors' repositories
_MOST_FILES = 1000
_MOST_BYTES = 1_000_000  # of a file
_MOST_LINE_CHARACTERS = 1000
_MOST_NUMBER = 1e6
_MOST_SHOWN = 80  # characters of a statement, in a reason
_FILE_NAME_PATTERN = re.compile(r"scenario_([1-9][0-9]{0,3})\.txt")
_TITLE_PATTERN = re.compile(r"title:([1-9][0-9]{0,3})_[\w-]{1,80}-(H[123])", re.ASCII)
_LOCATION_PATTERN = re.compile(r"location//([\w./]{1,100})//#([\w]{1,40}):HOOK#", re.ASCII)
_COUNT_PATTERN = re.compile(r"Total number of fault cases: ([0-9]{1,6})")
_FAULT_PATTERN = re.compile(r"fault ([1-9][0-9]{0,5})//if (.+?):((?://.+?)+)")
_PLAIN_NUMBER = r"-?[0-9]{1,12}(?:\.[0-9]{0,20})?(?:e-?[0-9]{1,2})?"
_NUMBER = rf"(\({_PLAIN_NUMBER}\)|{_PLAIN_NUMBER})"
_NAME = r"[A-Za-z_][\w.]*(?:\[\w+\][\w.]*)?"  # `self.lLane`, `tracks[ids].dRel`
_CHANGE_PATTERN = re.compile(rf"({_NAME})(\+=|-=|=){_NUMBER}", re.ASCII)
_LIMIT_PATTERN = re.compile(rf"if ({_NAME})(<|>=){_NUMBER}:", re.ASCII)
_LIMITED_PATTERN = re.compile(rf"  ({_NAME})= ?{_NUMBER}", re.ASCII)
_CAP_PATTERN = re.compile(rf"({_NAME}) = ([\w.]+\(.*\))", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """An assignment to a variable: `operator` is `+=`, `-=` or `=`."""

    variable: str
    operator: str
    number: float | int


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultLine:
    """One fault: its condition, the changes of variables, and what limits them afterwards, as text. No
    changes: the next statement of the source is left out. A `problem` says why the line cannot be read.
    """

    line: int
    number: int | None = None  # that the line gives the fault
    condition: str = ""
    changes: tuple[Change, ...] = ()
    limits: tuple[str, ...] = ()
    problem: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultFile:
    """A file of faults at one hook."""

    name: str  # path below the imported folder
    number: int
    aim: str
    source: str
    hook: str
    lines: tuple[FaultLine, ...]


def read_fault_files(folder: Path) -> tuple[tuple[FaultFile, ...], dict[str, str]]:
    """Return the fault files of a repository or its library, by number, and why other texts are not read.

    MutatorError for a folder without them, and, with the line, for a file that is not in the format.
    """
    if not folder.is_dir():
        raise MutatorError("no such folder", where=folder, expected="a checkout of the authors' repository")
    below = LIBRARY_FOLDER if (folder / LIBRARY_FOLDER).is_dir() else "."
    # not in the folders below: somebody may name a home folder
    paths = [checked_path_inside(folder, path) for path in sorted((folder / below).glob("*.txt"))]
    numbered = sorted(
        (int(match[1]), path) for path in paths if (match := _FILE_NAME_PATTERN.fullmatch(path.name))
    )
    if not numbered:
        raise MutatorError(
            "no fault files",
            where=folder / below,
            expected="files scenario_1.txt, scenario_2.txt ...",
            remedy="name the checkout, or the folder with these files",
        )
    if len(numbered) > _MOST_FILES:
        raise MutatorError(f"{len(numbered)} fault files", where=folder, expected=f"at most {_MOST_FILES}")
    ignored = {
        path.relative_to(folder).as_posix(): "its name is not scenario_<number>.txt"
        for path in paths
        if not _FILE_NAME_PATTERN.fullmatch(path.name)
    }
    return tuple(_read_file(path, number, folder) for number, path in numbered), ignored


def _read_file(path: Path, number: int, folder: Path) -> FaultFile:
    # no other character ends a line, so that numbers of lines are those of an editor
    lines = _text_of(path).rstrip("\r\n").split("\n")
    title = _match_line(path, lines, 1, _TITLE_PATTERN, "title:<number>_<name>-H1, -H2 or -H3")
    if int(title[1]) != number:
        raise MutatorError(
            f"title number {title[1]}", where=path, line=1, expected=f"{number}, as in the file's name"
        )
    location = _match_line(path, lines, 2, _LOCATION_PATTERN, "location//<file>//#<name>:HOOK#")
    faults = _without_repeated_numbers(
        _parse_fault(text, line)
        for line, text in enumerate(lines[2:], start=3)
        if _is_fault(path, text, line, is_last=line == len(lines))
    )
    count = _match_line(path, lines, len(lines), _COUNT_PATTERN, "Total number of fault cases: <number>")
    if int(count[1]) != len(faults):
        raise MutatorError(
            counted(len(faults), "fault"),
            where=path,
            line=len(lines),
            expected=f"{count[1]}, as this line says",
            remedy="fetch the file again; it may be cut",
        )
    return FaultFile(
        name=path.relative_to(folder).as_posix(),
        number=number,
        aim=title[2],
        source=location[1],
        hook=location[2],
        lines=faults,
    )


def _text_of(path: Path) -> str:
    try:
        return read_bounded(path, _MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as err:
        raise MutatorError(f"no UTF-8 at byte {err.start}", where=path, expected="a text file") from None
    except OSError as err:
        raise MutatorError(f"cannot be read ({err.strerror})", where=path, expected="a text file") from None


def _match_line(
    path: Path, lines: list[str], number: int, pattern: re.Pattern[str], expected: str
) -> re.Match[str]:
    text = lines[number - 1].rstrip() if 0 < number <= len(lines) else ""
    if match := pattern.fullmatch(text):
        return match
    raise MutatorError(shortened_repr(text), where=path, line=max(number, 1), expected=f"`{expected}`")


def _is_fault(path: Path, text: str, line: int, *, is_last: bool) -> bool:
    if is_last or not text.strip():
        return False
    if text.startswith("fault "):
        return True
    raise MutatorError(shortened_repr(text), where=path, line=line, expected="`fault <number>//if ...`")


def _without_repeated_numbers(faults: Iterable[FaultLine]) -> tuple[FaultLine, ...]:
    """Return the faults; one with the number of an earlier one has a problem."""
    first_by_number: dict[int, FaultLine] = {}
    return tuple(
        fault
        if fault.number is None or (first := first_by_number.setdefault(fault.number, fault)) is fault
        else FaultLine(line=fault.line, problem=f"fault number {fault.number}, as in line {first.line}")
        for fault in faults
    )


def _parse_fault(text: str, line: int) -> FaultLine:
    if len(text) > _MOST_LINE_CHARACTERS:
        return FaultLine(line=line, problem=f"longer than {_MOST_LINE_CHARACTERS} characters")
    match = _FAULT_PATTERN.fullmatch(text.rstrip())
    if not match:
        return FaultLine(line=line, problem="not of the form `fault <number>//if <condition>://<statement>`")
    number, condition, statements = int(match[1]), match[2], match[3].removeprefix("//").split("//")
    if statements == ["none"]:
        return FaultLine(line=line, number=number, condition=condition)
    try:
        changes, limits = _parse_statements(statements)
    except ValueError as error:
        return FaultLine(line=line, number=number, problem=str(error))
    return FaultLine(line=line, number=number, condition=condition, changes=changes, limits=limits)


def _parse_statements(statements: Iterable[str]) -> tuple[tuple[Change, ...], tuple[str, ...]]:
    """Return changes and limits; ValueError, with the reason, for anything else."""
    changes: list[Change] = []
    limits: list[str] = []
    for statement in statements:
        if change := _CHANGE_PATTERN.fullmatch(statement):
            changes.append(Change(variable=change[1], operator=change[2], number=_number(change[3])))
        elif any(p.fullmatch(statement) for p in (_LIMIT_PATTERN, _LIMITED_PATTERN, _CAP_PATTERN)):
            limits.append(statement.strip())
        else:
            raise ValueError(f"a statement that is not understood: {statement[:_MOST_SHOWN]}")
    if not changes:
        raise ValueError("no change of a variable")
    return tuple(changes), tuple(limits)


def _number(text: str) -> float | int:
    text = text.strip("()")
    number = float(text)
    if not math.isfinite(number) or abs(number) > _MOST_NUMBER:
        raise ValueError(f"a number beyond {_MOST_NUMBER:g}: {text}")
    return int(number) if re.fullmatch(r"-?[0-9]+", text) else number
