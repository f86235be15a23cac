"""The syntax of injected lines: tags, calls to the probe, and how to find them in files and patches.

Code inside a target's process cannot import this module, so engines pass the needed values to that code.
"""

import ast
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from mutator.config.location_syntax import PROBE_NAME
from mutator.model import Injection

IMPORT_TAG = "probe"  # on the line that imports the probe
OBSERVE_TAG = "observe"  # on the statement that passes the ground truth to the probe
ORIGINAL = "original"  # name of the original value in a line that sets a value
# an id in quotes, in a name or in a tag (a tag can have several ids), but not a number of eight digits
INJECTION_ID = (
    r"(?:(?:(?<=[\"'_])|(?<=fi:))[0-9a-f]{8}(?![0-9A-Za-z.])"
    r"|(?<=[0-9a-f]\+)[0-9a-f]{8}(?=(?:\+[0-9a-f]{8})* was:))"
)

_MARK = "# fi:"
_MARK_BYTES = _MARK.encode()
_TAG = rf"{_MARK}([0-9a-z]+(?:\+[0-9a-z]+)*)(?: guard:(\d+)| was:([^\r\n]*))?"
_TAG_OF_LINE = re.compile(rf"[ \t]*{_TAG}(?=\r?\n?\Z)".encode())
_NAME_IN_USE = re.compile(rf"\b{PROBE_NAME}\b".encode())
_ASKING = (  # checks of the instance or execution come first
    rf"(?:{PROBE_NAME}\.on\(\) and \(.*?\) and )?"
    rf'(?:{PROBE_NAME}\.(?:call|every)\("[0-9a-z]+", \d+\) and )?'
    rf'{PROBE_NAME}\.active\("(?P<id>[0-9a-z]+)"\)'
)
_GUARD = re.compile(rf"\s*if (?:not )?\(?{_ASKING}\)?(?: or {PROBE_NAME}\.steps\(\))?:\Z".encode())
_ASKED = re.compile(rf" if {_ASKING} else ".encode())
_OF_EXECUTION = [f"{PROBE_NAME}.{name}" for name in ("call", "every", "active")]
_SETS = re.compile(rf'\s*{PROBE_NAME}\.(?:constant|default)\("[0-9a-z]+", '.encode())
_TAGGED_ADDITION = re.compile(rf"^\+.*{_TAG}\r?$", re.MULTILINE)
_FAULT_ADDITION = re.compile(rf"^\+.*{_MARK}(?!{IMPORT_TAG}\b|{OBSERVE_TAG}\b)", re.MULTILINE)
_SETTING = re.compile(
    r"(?P<mutant>(?<![0-9A-Za-z])[0-9a-f]{16}(?![0-9A-Za-z]))"
    rf"|(?P<id>{INJECTION_ID})"
    r'|^\+HOLD = "(?P<hold>\w+)"$'
    r"|^\+HOLD_S = (?P<hold_s>.+)$"
    r"|^\+ARMED_AFTER_S = (?P<armed_after_s>.+)$"
    r"|^\+def _condition\(.*\n(?:\+    \w+ = .*\n)*\+    return (?P<condition>.+)$",
    re.MULTILINE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """The tag at the end of an injected line."""

    id: str  # an injection's id, IMPORT_TAG or OBSERVE_TAG; several ids are joined with `+`
    guarded: int  # number of lines that a guard indents
    code: bytes  # the line without the tag
    was: bytes | None = None  # the target's line that this line replaces

    @property
    def of_fault(self) -> bool:
        """Whether the line belongs to a fault; other tagged lines are in every mutant."""
        return self.id not in (IMPORT_TAG, OBSERVE_TAG)

    @property
    def asks_probe(self) -> bool:
        """Whether the line opens a block that the probe's answer guards."""
        return _GUARD.match(self.code) is not None

    @property
    def ids(self) -> list[str]:
        return self.id.split("+")

    @property
    def opens_original(self) -> bool:
        """Whether the line is the `else:` under which a guard keeps the target's statements."""
        return self.guarded > 0 and self.code.strip() == b"else:"

    @property
    def asked_for(self) -> list[str]:
        """The injections about which a changed line asks the probe."""
        return [match["id"].decode() for match in _ASKED.finditer(self.code)]

    @property
    def sets(self) -> bool:
        return _SETS.match(self.code) is not None


def changed_parts(source: bytes) -> Iterator[tuple[str, int, int, int]]:
    """Yield the injection id, line, start column and end column of each changed value and its instance check.

    Lines are counted from 1, columns in bytes of UTF-8, as in tracebacks.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.IfExp):
            terms = node.test.values if isinstance(node.test, ast.BoolOp) else [node.test]
            checks = [
                term
                for term in terms
                if isinstance(term, ast.Call) and ast.unparse(term.func) in _OF_EXECUTION
            ]
            if checks and isinstance(name := checks[0].args[0], ast.Constant):
                yield str(name.value), node.body.lineno, node.body.col_offset, checks[0].col_offset


def tag_of(line: bytes) -> Tag | None:
    """Return the tag of a line, with or without its line end; None for a line of the target."""
    if _MARK_BYTES not in line:
        return None
    match = _TAG_OF_LINE.search(line)
    if match is None:
        return None
    code = line[: match.start()]
    return Tag(id=match[1].decode(), guarded=int(match[2] or 0), code=code, was=match[3])


def tagged(code: str, tag: str, guarded: int = 0) -> str:
    """Add a tag to `code`. The tag of a guard's line includes the number of lines that the guard wraps."""
    return f"{code}  {_MARK}{tag}" + (f" guard:{guarded}" if guarded else "")


def tag_instead(ids: Iterable[str], was: bytes) -> bytes:
    return f"  {_MARK}{'+'.join(ids)} was:".encode() + was


def asks(tag: str) -> str:
    """Return the call that asks the probe whether the injection is active."""
    return f'{PROBE_NAME}.active("{tag}")'


def asks_for(tag: str, injection: Injection) -> str:
    """Return the condition under which an injection is active, with its limits to instances or executions.

    The limits are checked only while the fault is active.
    """
    terms = [f"{PROBE_NAME}.on()", f"({injection.where})"] if injection.where else []
    for name in ("call", "every"):
        if (number := getattr(injection, name)) is not None:
            terms.append(f'{PROBE_NAME}.{name}("{tag}", {number})')
    return " and ".join([*terms, asks(tag)])


def changed_value(condition: str, changed: str) -> str:
    """Return the source to put before an expression so that its value becomes `changed`.

    `condition` is the call that asks the probe whether to change the value.
    """
    return f"({changed} if {condition} else "


def set_constant(tag: str, path: str, changed: str, imported: Iterable[str]) -> str:
    """Return the line that makes the probe set the constant at `path` in its module.

    `imported`: imports of the constant in other modules.
    """
    further = "".join(f', "{name}"' for name in imported)
    return f'{PROBE_NAME}.constant("{tag}", globals(), "{path}", lambda {ORIGINAL}: {changed}{further})'


def set_default(tag: str, function: str, parameter: str, changed: str) -> str:
    where = f'globals(), "{function}", "{parameter}"'
    return f'{PROBE_NAME}.default("{tag}", {where}, lambda {ORIGINAL}: {changed})'


def sets_values(data: bytes) -> bool:
    return any(f"{PROBE_NAME}.{call}(".encode() in data for call in ("constant", "default"))


def tag_words() -> dict[str, Any]:
    return {"mark": _MARK, "probe": [IMPORT_TAG, OBSERVE_TAG]}


def import_statement(package: str | None) -> str:
    return tagged(f"from {package} import {PROBE_NAME}" if package else f"import {PROBE_NAME}", IMPORT_TAG)


def observe_call(expressions: Sequence[tuple[str, str]]) -> str:
    return f"{PROBE_NAME}.observe({', '.join(f'{name}={text}' for name, text in expressions)})"


def instrumented_line(data: bytes) -> int | None:
    """Return the index of a line with a tag, or else with the probe's name; None if there is neither."""
    if _MARK.encode() in data:
        for index, line in enumerate(data.splitlines(keepends=True)):
            if tag_of(line):
                return index
    match = _NAME_IN_USE.search(data)
    return data[: match.start()].count(b"\n") if match else None


# Injected lines in patches


def tagged_additions(patch: str, begin: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield start and end, without the `+`, of each tagged line that `patch[begin:end]` adds."""
    for line in _TAGGED_ADDITION.finditer(patch, begin, end):
        yield line.start() + 1, line.end()


def adds_fault(hunk: str) -> bool:
    return _FAULT_ADDITION.search(hunk) is not None


def settings(patch: str, begin: int, end: int) -> Iterator[tuple[int, int, str]]:
    """Yield begin, end and name of each setting that can differ between probes."""
    for match in _SETTING.finditer(patch, begin, _end_of_settings(patch, begin, end)):
        name = match.lastgroup or ""
        yield *match.span(name), name


def _end_of_settings(patch: str, begin: int, end: int) -> int:
    """Return the end of the trigger's condition. The rest of a probe is long and always the same."""
    condition = patch.find("\n+def _condition(", begin, end)
    line = patch.find("\n+    return ", condition, end) if condition >= 0 else -1
    return end if line < 0 else patch.find("\n", line + 1, end) + 1 or end
