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

_ESCAPED = {b"\\": b"\\\\", b'"': b'\\"', b"\r": b"\\r", b"\n": b"\\n"}
_PLAIN = {escaped: plain for plain, escaped in _ESCAPED.items()}
_SPECIAL, _ESCAPE = re.compile(rb'[\\"\r\n]'), re.compile(rb'\\[\\"rn]')
_CALL = re.compile(rb'SeriesFile\.loaded\("([0-9a-z]+)","')
_END = b'");\n'
NAME_LENGTH = 16  # hex digits of the SHA-256 in a file's name


def name_of(data: bytes) -> str:
    return digest(data)[:NAME_LENGTH]


def size_in_script(data: bytes) -> int:
    return len(data) + sum(map(data.count, _ESCAPED))


def write_script(path: Path, data: bytes) -> None:
    """Write a script that passes `data` to the page, under the file's name."""
    write_atomic(path, script_of(path.stem, data))


def script_of(name: str, data: bytes) -> bytes:
    text = _SPECIAL.sub(lambda found: _ESCAPED[found[0]], data)
    return b"".join((f'SeriesFile.loaded("{name}","'.encode(), text, _END))


def read_script(path: Path) -> bytes:
    """Return the data in a script; MutatorError if it is missing or invalid."""
    try:
        text = read_bounded(path)
    except OSError as err:
        raise MutatorError(f"cannot be read ({err.strerror})", where=path) from None
    call = _CALL.match(text)
    if call is None or call[1].decode() != path.stem or not text.endswith(_END):
        raise MutatorError("damaged", where=path, expected="an unchanged file of series")
    return _ESCAPE.sub(lambda found: _PLAIN[found[0]], text[call.end() : -len(_END)])
