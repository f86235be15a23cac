"""The syntax of injected lines: tags, calls to the probe, and how to find them in files and patches.

Code inside a target's process cannot import this module, so engines pass the needed values to that code.
"""

import ast
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from mutator.config.location_syntax import DEFENCE_MODULE_NAME, PROBE_MODULE_NAME
from mutator.model import Injection

PROBE_IMPORT_TAG = "probe"  # on the line that imports the probe
OBSERVATION_TAG = "observe"  # on the statement that passes the ground truth to the probe
ORIGINAL_VALUE_NAME = "original"  # name of the original value in a line that sets a value
# an id in quotes, in a name or in a tag (a tag can have several ids), but not a number of eight digits
INJECTION_ID_PATTERN = (
    r"(?:(?:(?<=[\"'_])|(?<=fi:))[0-9a-f]{8}(?![0-9A-Za-z.])"
    r"|(?<=[0-9a-f]\+)[0-9a-f]{8}(?=(?:\+[0-9a-f]{8})* was:))"
)

_TAG_START = "# fi:"
# most lines have no tag: searching for these bytes first is faster than matching the pattern
_TAG_START_BYTES = _TAG_START.encode()
_TAG_PATTERN = rf"{_TAG_START}([0-9a-z]+(?:\+[0-9a-z]+)*)(?: guard:(\d+)| was:([^\r\n]*))?"
# only at the end of a line, because a string of the target can contain the text of a tag
_TAG_AT_LINE_END_PATTERN = re.compile(rf"[ \t]*{_TAG_PATTERN}(?=\r?\n?\Z)".encode())
# checks of the instance or execution come first; `listens` is the check of faults of messages
_ACTIVE_CHECK_PATTERN = (
    rf"(?:{PROBE_MODULE_NAME}\.on\(\) and \(.*?\) and )?"
    rf'(?:{PROBE_MODULE_NAME}\.(?:call|every)\("[0-9a-z]+", \d+\) and )?'
    rf'{PROBE_MODULE_NAME}\.(?:active|listens)\("(?P<id>[0-9a-z]+)"\)'
)
# a drift that stays after its trigger has ended guards its lines with `or _fi.steps()`
_GUARD_PATTERN = re.compile(
    rf"\s*if (?:not )?\(?{_ACTIVE_CHECK_PATTERN}\)?(?: or {PROBE_MODULE_NAME}\.steps\(\))?:\Z".encode()
)
_CHANGED_VALUE_PATTERN = re.compile(rf" if {_ACTIVE_CHECK_PATTERN} else ".encode())
_PROBE_CHECK_CALLS = [f"{PROBE_MODULE_NAME}.{name}" for name in ("call", "every", "active")]
_CONSTANT_OR_DEFAULT_SETTING_PATTERN = re.compile(
    rf'\s*{PROBE_MODULE_NAME}\.(?:constant|default)\("[0-9a-z]+", '.encode()
)
_TAGGED_ADDITION_PATTERN = re.compile(rf"^\+.*{_TAG_PATTERN}\r?$", re.MULTILINE)
_FAULT_ADDITION_PATTERN = re.compile(
    rf"^\+.*{_TAG_START}(?!{PROBE_IMPORT_TAG}\b|{OBSERVATION_TAG}\b)", re.MULTILINE
)
# mutants whose probes differ only in these values can have the same shape, and share a review
_PROBE_SETTING_PATTERN = re.compile(
    r"(?P<mutant>(?<![0-9A-Za-z])[0-9a-f]{16}(?![0-9A-Za-z]))"
    rf"|(?P<id>{INJECTION_ID_PATTERN})"
    r'|^\+HOLD = "(?P<hold>\w+)"$'
    r"|^\+HOLD_S = (?P<hold_s>.+)$"
    r"|^\+ARMED_AFTER_S = (?P<armed_after_s>.+)$"
    r"|^\+def _condition\(.*\n(?:\+    \w+ = .*\n)*\+    return (?P<condition>.+)$",
    re.MULTILINE,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tag:
    """The tag at the end of an injected line."""

    id: str  # an injection's id, PROBE_IMPORT_TAG or OBSERVATION_TAG; several ids are joined with `+`
    guarded_line_count: int  # number of lines that a guard indents
    line_without_tag: bytes  # the line without the tag
    replaced_line: bytes | None = None  # the target's line that this line replaces

    @property
    def is_of_fault(self) -> bool:
        """Whether the line belongs to a fault; other tagged lines are in every mutant."""
        return self.id not in (PROBE_IMPORT_TAG, OBSERVATION_TAG)

    @property
    def is_guard(self) -> bool:
        """Whether the line opens a block that the probe's answer guards."""
        return _GUARD_PATTERN.match(self.line_without_tag) is not None

    @property
    def ids(self) -> list[str]:
        return self.id.split("+")

    @property
    def is_else_of_guard(self) -> bool:
        """Whether the line is the `else:` under which a guard keeps the target's statements."""
        return self.guarded_line_count > 0 and self.line_without_tag.strip() == b"else:"

    @property
    def changed_value_ids(self) -> list[str]:
        """The injections about which a changed line asks the probe."""
        return [match["id"].decode() for match in _CHANGED_VALUE_PATTERN.finditer(self.line_without_tag)]

    @property
    def is_constant_or_default_setting(self) -> bool:
        return _CONSTANT_OR_DEFAULT_SETTING_PATTERN.match(self.line_without_tag) is not None


def changed_value_positions(source: bytes) -> Iterator[tuple[str, int, int, int]]:
    """Yield the injection id, line, start column and end column of each changed value and its instance check.

    Lines are counted from 1, columns in bytes of UTF-8, as in tracebacks.
    """
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.IfExp):
            terms = node.test.values if isinstance(node.test, ast.BoolOp) else [node.test]
            checks = [
                term
                for term in terms
                if isinstance(term, ast.Call) and ast.unparse(term.func) in _PROBE_CHECK_CALLS
            ]
            if checks and isinstance(name := checks[0].args[0], ast.Constant):
                yield str(name.value), node.body.lineno, node.body.col_offset, checks[0].col_offset


def tag_of(line: bytes) -> Tag | None:
    """Return the tag of a line, with or without its line end; None for a line of the target."""
    if _TAG_START_BYTES not in line:
        return None
    match = _TAG_AT_LINE_END_PATTERN.search(line)
    if match is None:
        return None
    code = line[: match.start()]
    return Tag(
        id=match[1].decode(),
        guarded_line_count=int(match[2] or 0),
        line_without_tag=code,
        replaced_line=match[3],
    )


def target_line_of(mutated: bytes, line: int, ids_before_anchor: Collection[str] = ()) -> int:
    """Return the line in the target's own file, from 1, of a line of the mutated file.

    An injected line has the line of the statement at which it was injected: the one below it if its id is one
    of `ids_before_anchor`, else the one above it.
    """
    tags = [tag_of(text) for text in mutated.splitlines()[:line]]
    target_lines = sum(tag is None or tag.replaced_line is not None for tag in tags)
    last = tags[-1] if tags else None
    is_above_anchor = last and last.replaced_line is None and last.id in ids_before_anchor
    return max(1, target_lines + bool(is_above_anchor))


def mutated_line_of(mutated: bytes, target_line: int) -> int:
    """Return the line in the mutated file of a line of the target's own file, both from 1."""
    lines = enumerate(mutated.splitlines(), start=1)
    line_numbers = (n for n, text in lines if (tag := tag_of(text)) is None or tag.replaced_line is not None)
    return next(islice(line_numbers, target_line - 1, None), target_line)


def place_in_target(
    path: str, line: int, changed_files: Mapping[str, bytes], ids_before_anchor: Collection[str]
) -> str:
    """Return `file:line` in the target's own tree of a line of a tree with these changed files."""
    if path in changed_files:
        line = target_line_of(changed_files[path], line, ids_before_anchor)
    return f"{path}:{line}"


def tagged_line(code: str, tag: str, guarded_line_count: int = 0) -> str:
    """Add a tag to `code`. The tag of a guard's line includes the number of lines that the guard wraps."""
    return f"{code}  {_TAG_START}{tag}" + (f" guard:{guarded_line_count}" if guarded_line_count else "")


def replacement_tag(ids: Iterable[str], replaced_line: bytes) -> bytes:
    return f"  {_TAG_START}{'+'.join(ids)} was:".encode() + replaced_line


def active_check_source(tag: str) -> str:
    """Return the call that asks the probe whether the injection is active."""
    return f'{PROBE_MODULE_NAME}.active("{tag}")'


def listening_check_source(tag: str) -> str:
    """Return the call that asks the probe whether the injection changes messages now."""
    return f'{PROBE_MODULE_NAME}.listens("{tag}")'


def activation_condition(tag: str, injection: Injection, check: str | None = None) -> str:
    """Return the condition under which an injection is active, with its limits to instances or executions.

    It ends with `check`, by default that of `active_check_source`. The limits are checked only while the
    fault is active.
    """
    terms = [f"{PROBE_MODULE_NAME}.on()", f"({injection.where})"] if injection.where else []
    for name in ("call", "every"):
        if (number := getattr(injection, name)) is not None:
            terms.append(f'{PROBE_MODULE_NAME}.{name}("{tag}", {number})')
    return " and ".join([*terms, check or active_check_source(tag)])


def changed_value_prefix(condition: str, changed: str) -> str:
    """Return the source to put before an expression so that its value becomes `changed`.

    `condition` is the call that asks the probe whether to change the value.
    """
    return f"({changed} if {condition} else "


def constant_setting_line(tag: str, path: str, changed: str, imported: Iterable[str]) -> str:
    """Return the line that makes the probe set the constant at `path` in its module.

    `imported`: imports of the constant in other modules.
    """
    further = "".join(f', "{name}"' for name in imported)
    new_value = f"lambda {ORIGINAL_VALUE_NAME}: {changed}"
    return f'{PROBE_MODULE_NAME}.constant("{tag}", globals(), "{path}", {new_value}{further})'


def default_setting_line(tag: str, function: str, parameter: str, changed: str) -> str:
    where = f'globals(), "{function}", "{parameter}"'
    return f'{PROBE_MODULE_NAME}.default("{tag}", {where}, lambda {ORIGINAL_VALUE_NAME}: {changed})'


def has_constant_or_default_settings(data: bytes) -> bool:
    return any(f"{PROBE_MODULE_NAME}.{call}(".encode() in data for call in ("constant", "default"))


def tags_for_page_scripts() -> dict[str, Any]:
    return {"mark": _TAG_START, "probe": [PROBE_IMPORT_TAG, OBSERVATION_TAG]}


def probe_import_line(package: str | None) -> str:
    return tagged_line(
        f"from {package} import {PROBE_MODULE_NAME}" if package else f"import {PROBE_MODULE_NAME}",
        PROBE_IMPORT_TAG,
    )


def defence_line(code: str, tag: str) -> str:
    """Return a line of a defence: `import`, `observe` or `command`."""
    return f"{code}  # fd:{tag}"


def defence_import_line(package: str | None) -> str:
    name = DEFENCE_MODULE_NAME
    return defence_line(f"from {package} import {name}" if package else f"import {name}", "import")


def observation_call_source(expressions: Sequence[tuple[str, str]]) -> str:
    return f"{PROBE_MODULE_NAME}.observe({', '.join(f'{name}={text}' for name, text in expressions)})"


def find_tagged_line(data: bytes) -> int | None:
    """Return the index of the first line with a tag, None if there is none."""
    if _TAG_START_BYTES in data:
        for index, line in enumerate(data.splitlines(keepends=True)):
            if tag_of(line):
                return index
    return None


# Injected lines in patches


def tagged_addition_spans(patch: str, begin: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield start and end, without the `+`, of each tagged line that `patch[begin:end]` adds."""
    for line in _TAGGED_ADDITION_PATTERN.finditer(patch, begin, end):
        yield line.start() + 1, line.end()


def adds_fault(hunk: str) -> bool:
    return _FAULT_ADDITION_PATTERN.search(hunk) is not None


def probe_setting_spans(patch: str, begin: int, end: int) -> Iterator[tuple[int, int, str]]:
    """Yield begin, end and name of each setting that can differ between probes."""
    for match in _PROBE_SETTING_PATTERN.finditer(patch, begin, _end_of_probe_settings(patch, begin, end)):
        name = match.lastgroup or ""
        yield *match.span(name), name


def _end_of_probe_settings(patch: str, begin: int, end: int) -> int:
    """Return the end of the trigger's condition. The rest of a probe is long and always the same."""
    condition = patch.find("\n+def _condition(", begin, end)
    line = patch.find("\n+    return ", condition, end) if condition >= 0 else -1
    return end if line < 0 else patch.find("\n", line + 1, end) + 1 or end
