"""The patches of a run folder: packed, each as what it has beside another one, which most of it is.

Each worker appends to a file of its own, `patches/<session>-<worker>.blocks`. Folders of earlier schemas have
a file a patch, `patches/<xx>/<experiment>.patch`. Whether one is what was run, the digest in its record says.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator._common.files import write_atomic
from mutator._common.hashing import digest
from mutator.store.blocks import Block, BlockWriter, as_block, intact_blocks, read_blocks

FOLDER, SUFFIX = "patches", ".blocks"
WHOLE, BESIDE = 0, 1  # kinds of blocks: a patch by itself, or beside the last whole one before it
_WINDOW = 32_768  # bytes that deflate looks back
_RUN = 256  # patches to a whole one: what depends on it is lost with it
_LEVEL = 9


class _Packer:
    """Makes the blocks of one file."""

    def __init__(self) -> None:
        self._count = 0
        self._whole = b""

    def block(self, data: bytes) -> tuple[int, bytes]:
        """Kind and content of the block of the next patch."""
        is_whole = self._count % _RUN == 0
        self._count += 1
        if is_whole:
            self._whole = data[-_WINDOW:]
            return WHOLE, zlib.compress(data, _LEVEL)
        packer = zlib.compressobj(_LEVEL, zdict=self._whole)
        return BESIDE, packer.compress(data) + packer.flush()


class PatchWriter:
    """Appends the patches of a worker."""

    def __init__(self, run: Path, worker: str) -> None:
        self._path = run / FOLDER / f"{worker}{SUFFIX}"
        self._blocks: BlockWriter | None = None  # nothing was appended yet
        self._packer = _Packer()

    def append(self, experiment_id: str, data: bytes) -> None:
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        kind, content = self._packer.block(data)
        self._blocks.append(kind, experiment_id, content)

    def extend(self, blocks: bytes) -> None:
        """Append the blocks that `packed_patches` made elsewhere."""
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        self._blocks.extend(blocks)

    def sync(self) -> None:
        """Make sure that what was appended survives a power cut."""
        if self._blocks is not None:
            self._blocks.sync()

    def close(self) -> None:
        if self._blocks is not None:
            self._blocks.close()


class _Whole:
    """A whole patch, unpacked once."""

    def __init__(self, block: Block) -> None:
        self._block = block

    @cached_property
    def data(self) -> bytes:
        return zlib.decompress(self._block.data)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a patch is: its block, and the whole patch that it is beside, or is."""

    path: Path
    block: Block
    whole: _Whole | None


def _unpacked(block: Block, whole: _Whole | None) -> bytes | None:
    """The patch of a block; None where the whole patch that it is beside is lost."""
    try:
        if block.kind == WHOLE or whole is None:
            return whole.data if whole is not None and block.kind == WHOLE else zlib.decompress(block.data)
        packer = zlib.decompressobj(zdict=whole.data[-_WINDOW:])
        return packer.decompress(block.data) + packer.flush()
    except zlib.error:
        return None


class Patches:
    """Reads the patches of the run folder at `run`."""

    def __init__(self, run: Path) -> None:
        self.run = run

    def __iter__(self) -> Iterator[str]:
        """Every experiment that a patch is there of."""
        old = (path.stem for path in (self.run / FOLDER).glob("*/*.patch"))
        return iter(sorted({*self._places, *old}))

    def read(self, experiment_id: str) -> bytes | None:
        """The newest patch of an experiment; None where none is there, or only a damaged one."""
        place = self._places.get(experiment_id)
        if place is None:
            path = self.old_file(experiment_id)
            return path.read_bytes() if path.is_file() else None
        return _unpacked(place.block, place.whole)

    def digests(self) -> Iterator[tuple[str, str]]:
        """Each experiment that a patch is packed of, and the SHA-256 of the patch, empty for a damaged one; a
        newer one comes later. They are unpacked one at a time."""
        for path in filter(Path.is_file, self.files()):
            whole: _Whole | None = None
            for block in intact_blocks(path):
                whole = _Whole(block) if block.kind == WHOLE else whole
                data = _unpacked(block, whole)
                yield block.key, "" if data is None else digest(data)

    def file(self, experiment_id: str, worker: str = "") -> Path:
        """The file that has it, or that would have it if it were there: a damaged one, else that of the
        `worker` whose record names it, if that is known."""
        place = self._places.get(experiment_id)
        if place is not None:
            return place.path
        path = self.old_file(experiment_id)
        if path.exists():
            return path
        damaged = (one for one in self.files() if not one.is_file() or read_blocks(one).damaged)
        lost = self.run / FOLDER / f"{worker}{SUFFIX}" if worker else self.run / FOLDER
        return next(damaged, lost)

    def old_file(self, experiment_id: str) -> Path:
        """Where folders of earlier schemas have it."""
        return self.run / FOLDER / experiment_id[:2] / f"{experiment_id}.patch"

    def files(self) -> list[Path]:
        """The files of blocks, oldest session first, and what else has such a name."""
        return sorted((self.run / FOLDER).glob(f"*{SUFFIX}"))

    @cached_property
    def _places(self) -> dict[str, _Place]:
        found: dict[str, _Place] = {}
        for path in filter(Path.is_file, self.files()):  # nobody waits for what a pipe may say
            whole: _Whole | None = None
            for block in read_blocks(path).blocks:
                if block.kind == WHOLE:
                    whole = _Whole(block)
                found[block.key] = _Place(path, block, whole)
        return found


def rewrite(path: Path, patches: Iterable[tuple[str, bytes]]) -> None:
    """Write a file of blocks anew, with these patches alone."""
    write_atomic(path, packed_patches(patches))


def packed_patches(patches: Iterable[tuple[str, bytes]]) -> bytes:
    """The blocks of patches that need no others before them: a file, or a part of one."""
    packer, blocks = _Packer(), []
    for experiment_id, data in patches:
        kind, content = packer.block(data)
        blocks.append(as_block(kind, experiment_id, content))
    return b"".join(blocks)
