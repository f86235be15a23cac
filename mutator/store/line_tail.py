"""Follow files of checksummed lines while their writers append to them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mutator._common.confined_files import open_below
from mutator.errors import UnsafePath
from mutator.store.checksummed_lines import checksum_of_line, is_intact_line


@dataclass(slots=True)
class _ReadUntil:
    offset: int = 0
    last_checksum: bytes = b""


class LineTail:
    """The lines of all files of a folder of a run, each read once. Damaged lines are left out, and a line
    that is still being written is read when it is complete.
    """

    def __init__(self, run: Path, folder: str) -> None:
        self._run, self._folder = run, folder
        self._read_until_by_file: dict[str, _ReadUntil] = {}
        self.has_more = False  # whether `read_new_lines` left out complete lines

    def read_new_lines(self, most_bytes: int | None = None) -> Iterator[bytes]:
        """Yield the lines that were appended since the last call, at most `most_bytes` of each file."""
        self.has_more = False
        for path in sorted((self._run / self._folder).glob("*.jsonl")):
            yield from self._read_file(path.name, -1 if most_bytes is None else most_bytes)

    def _read_file(self, name: str, most_bytes: int) -> Iterator[bytes]:
        place = self._read_until_by_file.setdefault(name, _ReadUntil())
        try:
            with open_below(self._run, f"{self._folder}/{name}") as file:
                file.seek(place.offset)
                data = file.read(most_bytes)
        except (OSError, UnsafePath):  # it was set aside
            return
        end = data.rfind(b"\n") + 1
        self.has_more |= len(data) == most_bytes and end > 0
        place.offset += end
        for line in data[:end].split(b"\n")[:-1]:
            if is_intact_line(place.last_checksum, line):
                yield line
            place.last_checksum = checksum_of_line(line)
