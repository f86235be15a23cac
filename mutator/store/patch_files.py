"""The patches of a run folder, packed. Most are stored as a difference from another patch.

Each worker appends to its own file, `patches/<session>-<worker>.blocks`.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator._common.bounded_reading import unpacked
from mutator._common.confined_files import inside
from mutator._common.files import write_atomic
from mutator._common.hashing import digest
from mutator.store.checksummed_blocks import Block, BlockWriter, block_bytes, intact_blocks, read_blocks

FOLDER, SUFFIX = "patches", ".blocks"
WHOLE, BESIDE = 0, 1  # kinds of blocks: a complete patch, or a difference from the last complete one
_WINDOW = 32_768  # window size of deflate, in bytes
_RUN = 256  # patches that depend on one complete patch, and are lost with it
_LEVEL = 9
MOST_PATCH = 16_000_000  # bytes


class _Packer:
    """Create the blocks of one file."""

    def __init__(self) -> None:
        self._count = 0
        self._whole = b""

    def block(self, data: bytes) -> tuple[int, bytes]:
        """Return the kind and content of the block for the next patch."""
        is_whole = self._count % _RUN == 0
        self._count += 1
        if is_whole:
            self._whole = data[-_WINDOW:]
            return WHOLE, zlib.compress(data, _LEVEL)
        packer = zlib.compressobj(_LEVEL, zdict=self._whole)
        return BESIDE, packer.compress(data) + packer.flush()


class PatchWriter:
    """Append the patches of a worker."""

    def __init__(self, run: Path, worker: str) -> None:
        self._path = inside(run / FOLDER, f"{worker}{SUFFIX}")
        self._blocks: BlockWriter | None = None  # nothing appended yet
        self._packer = _Packer()

    def append(self, experiment_id: str, data: bytes) -> None:
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        kind, content = self._packer.block(data)
        self._blocks.append(kind, experiment_id, content)

    def extend(self, blocks: bytes) -> None:
        """Append blocks that `packed_patches` returned."""
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        self._blocks.extend(blocks)

    def sync(self) -> None:
        if self._blocks is not None:
            self._blocks.sync()

    def close(self) -> None:
        if self._blocks is not None:
            self._blocks.close()


class _Whole:
    """A complete patch."""

    def __init__(self, block: Block) -> None:
        self._block = block

    @property
    def data(self) -> bytes:
        return unpacked(self._block.data, MOST_PATCH)

    @cached_property
    def end(self) -> bytes:
        """The part to which other patches refer."""
        return self.data[-_WINDOW:]


@dataclass(frozen=True, slots=True)
class _Place:
    """A patch's file and block, and the complete patch on which it depends (itself, if complete)."""

    path: Path
    block: Block
    whole: _Whole | None


def _unpacked(block: Block, whole: _Whole | None) -> bytes | None:
    """Return the patch in a block; None if it or the complete patch on which it depends is damaged."""
    try:
        if block.kind == WHOLE or whole is None:
            return unpacked(block.data, MOST_PATCH)
        return unpacked(block.data, MOST_PATCH, whole.end)
    except (zlib.error, ValueError):
        return None


class Patches:
    def __init__(self, run: Path) -> None:
        self.run = run

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._places))

    def read(self, experiment_id: str) -> bytes | None:
        """Return the newest patch of an experiment; None if it is missing or damaged."""
        place = self._places.get(experiment_id)
        return None if place is None else _unpacked(place.block, place.whole)

    def digests(self) -> Iterator[tuple[str, str]]:
        """Yield each experiment that has a packed patch, and its SHA-256 (empty if damaged), oldest first."""
        for path in filter(Path.is_file, self.files()):
            whole: _Whole | None = None
            for block in intact_blocks(path):
                whole = _Whole(block) if block.kind == WHOLE else whole
                data = _unpacked(block, whole)
                yield block.key, "" if data is None else digest(data)

    def file(self, experiment_id: str, worker: str = "") -> Path:
        """Return the file that contains, or should contain, an experiment's patch.

        If the patch is not stored, return a damaged file; if none is damaged, the file of `worker`, if given,
        or else the folder.
        """
        place = self._places.get(experiment_id)
        if place is not None:
            return place.path
        damaged = (one for one in self.files() if not one.is_file() or read_blocks(one).is_damaged)
        lost = inside(self.run / FOLDER, f"{worker}{SUFFIX}") if worker else self.run / FOLDER
        return next(damaged, lost)

    def files(self) -> list[Path]:
        """Return the block files, oldest session first. A folder with such a name is included."""
        return sorted((self.run / FOLDER).glob(f"*{SUFFIX}"))

    @cached_property
    def _places(self) -> dict[str, _Place]:
        found: dict[str, _Place] = {}
        for path in filter(Path.is_file, self.files()):  # never block on a pipe
            whole: _Whole | None = None
            for block in read_blocks(path).blocks:
                if block.kind == WHOLE:
                    whole = _Whole(block)
                found[block.key] = _Place(path, block, whole)
        return found


def rewrite(path: Path, patches: Iterable[tuple[str, bytes]]) -> None:
    write_atomic(path, packed_patches(patches))


def packed_patches(patches: Iterable[tuple[str, bytes]]) -> bytes:
    """Return patches as blocks that need no earlier blocks, for a whole file or a part of one."""
    packer, blocks = _Packer(), []
    for experiment_id, data in patches:
        kind, content = packer.block(data)
        blocks.append(block_bytes(kind, experiment_id, content))
    return b"".join(blocks)
