"""A pseudo-terminal: runs a command line in this process, and reads the screen as a person would."""

import fcntl
import os
import re
import struct
import sys
import termios
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from mutator.cli.app import main

_LINES = 50
# what programs of this project send to a terminal: text, colours, and moves of the cursor by bars
_ESCAPE_PATTERN = re.compile(r"\x1b\[(\??[0-9;]*)([A-Za-z])")


def run_in_terminal(width: int, *words: str) -> tuple[int, str]:
    """Run `mutator WORDS...` in a terminal of so many columns; return its exit code and what was sent."""
    with pseudo_terminal(width) as received:
        code = main(list(words))
    return code, b"".join(received).decode()


def lines_to_copy(text: str) -> list[str]:
    """Return the lines as they are copied: a terminal joins the lines that it has broken itself."""
    return lines_on_screen(text, sys.maxsize)


@contextmanager
def pseudo_terminal(width: int) -> Iterator[list[bytes]]:
    """Connect the standard streams with a pseudo-terminal; yield what it has received."""
    master, slave = os.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", _LINES, width, 0, 0))
    received: list[bytes] = []
    reader = threading.Thread(target=_read_all, args=(master, received))
    before = [os.dup(number) for number in range(3)]
    streams = sys.stdin, sys.stdout, sys.stderr
    try:
        for number in range(3):
            os.dup2(slave, number)
        os.close(slave)
        sys.stdin, sys.stdout, sys.stderr = (
            open(number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115
            for number, mode in enumerate(("r", "w", "w"))
        )
        reader.start()
        yield received
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdin, sys.stdout, sys.stderr = streams
        for number, saved in enumerate(before):
            os.dup2(saved, number)  # closes the terminal, which ends the reader
            os.close(saved)
        reader.join()
        os.close(master)


def _read_all(fd: int, received: list[bytes]) -> None:
    while True:
        try:
            data = os.read(fd, 65536)
        except OSError:  # the other side is closed
            return
        if not data:
            return
        received.append(data)


def lines_on_screen(text: str, width: int) -> list[str]:
    """Return the lines that a terminal of so many columns shows, without trailing spaces."""
    screen: list[list[str]] = [[]]
    row = column = 0
    for part in re.split(r"(\x1b\[\??[0-9;]*[A-Za-z]|[\r\n])", text):
        if escape := _ESCAPE_PATTERN.fullmatch(part):
            number, letter = int(escape[1]) if escape[1].isdecimal() else 1, escape[2]
            assert letter in "AKmhl", part
            if letter == "A":
                row = max(0, row - number)
            elif letter == "K":
                screen[row] = [] if escape[1] == "2" else screen[row][:column]
        elif part == "\r":
            column = 0
        elif part == "\n":
            row += 1
            screen += [[] for _ in range(row - len(screen) + 1)]
        else:
            for character in part:
                if column == width:  # as a terminal breaks a line: wherever it ends
                    row, column = row + 1, 0
                    screen += [[] for _ in range(row - len(screen) + 1)]
                line = screen[row]
                line += " " * (column - len(line) + 1)
                line[column] = character
                column += 1
    lines = ["".join(line).rstrip() for line in screen]
    while lines and not lines[-1]:
        lines.pop()
    return lines
