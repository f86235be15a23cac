"""The lines that defences add to a file of the target. Each ends in a tag, `# fd:<what>`.

They are simple statements that open no block and do not begin inside a statement, so a file without them, or
with empty lines instead, has the same statements as before.
"""

import re

_TAG_START_BYTES = b"# fd:"  # most files have no such line: searching for these bytes first is fast
_LINE_PATTERN = re.compile(rb"^(\xef\xbb\xbf)?[^\r\n]*# fd:(?:import|observe|command)(?=\r?$)", re.MULTILINE)
_WHOLE_LINE_PATTERN = re.compile(rb"[^\r\n]*# fd:(import|observe|command)(?:\r?\n)?")


def defence_tag_of(line: bytes) -> str | None:
    """Return what a line of a defence does: `import`, `observe` or `command`; None for another line."""
    match = _WHOLE_LINE_PATTERN.fullmatch(line) if _TAG_START_BYTES in line else None
    return match[1].decode() if match else None


def with_empty_defence_lines(data: bytes) -> bytes:
    """Return a file with empty lines instead of those of defences, so that line numbers are the same."""
    return _LINE_PATTERN.sub(rb"\1", data) if _TAG_START_BYTES in data else data


def without_defence_lines(data: bytes) -> bytes:
    """Return the target's own file."""
    if _TAG_START_BYTES not in data:
        return data
    mark = b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b""
    lines = data.removeprefix(mark).splitlines(keepends=True)
    result = [line for line in lines if defence_tag_of(line) is None]
    if result and defence_tag_of(lines[-1]) and not lines[-1].endswith((b"\n", b"\r")):
        result[-1] = result[-1].rstrip(b"\r\n")
    return mark + b"".join(result)
