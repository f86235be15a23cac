"""Store bytes in a script that a page opened from disk can load, with little overhead.

Such a page cannot read files, but it can run scripts. The script calls a function with a string of one
character per byte. The page loads it as `x-user-defined`, an encoding in which each byte is a character.
"""

import re
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import write_atomic
from mutator._common.hashing import digest
from mutator.errors import MutatorError

_ESCAPE_BY_BYTE = {b"\\": b"\\\\", b'"': b'\\"', b"\r": b"\\r", b"\n": b"\\n"}
_BYTE_BY_ESCAPE = {escaped: plain for plain, escaped in _ESCAPE_BY_BYTE.items()}
_SPECIAL_BYTE_PATTERN, _ESCAPE_PATTERN = re.compile(rb'[\\"\r\n]'), re.compile(rb'\\[\\"rn]')
_CALL_PATTERN = re.compile(rb'SeriesFile\.loaded\("([0-9a-z]+)","')
_SCRIPT_END = b'");\n'
NAME_DIGITS = 16  # hex digits of the SHA-256 in a file's name


def script_name_of(data: bytes) -> str:
    return digest(data)[:NAME_DIGITS]


def size_in_script(data: bytes) -> int:
    return len(data) + sum(map(data.count, _ESCAPE_BY_BYTE))


def write_script(path: Path, data: bytes) -> None:
    """Write a script that passes `data` to the page, under the file's name."""
    write_atomic(path, script_bytes(path.stem, data))


def script_bytes(name: str, data: bytes) -> bytes:
    text = _SPECIAL_BYTE_PATTERN.sub(lambda match: _ESCAPE_BY_BYTE[match[0]], data)
    return b"".join((f'SeriesFile.loaded("{name}","'.encode(), text, _SCRIPT_END))


def read_script(path: Path) -> bytes:
    """Return the data in a script; MutatorError if it is missing or invalid."""
    try:
        text = read_bounded(path)
    except OSError as err:
        raise MutatorError(f"cannot be read ({err.strerror})", where=path) from None
    call = _CALL_PATTERN.match(text)
    if call is None or call[1].decode() != path.stem or not text.endswith(_SCRIPT_END):
        raise MutatorError("damaged", where=path, expected="an unchanged file of series")
    return _ESCAPE_PATTERN.sub(lambda match: _BYTE_BY_ESCAPE[match[0]], text[call.end() : -len(_SCRIPT_END)])
