"""The patches of a run folder, packed. Most are stored as a difference from another patch.

Each worker appends to its own file, `patches/<session>-<worker>.blocks`.
"""

import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mutator._common.bounded_reading import decompress_bounded
from mutator._common.confined_files import path_below
from mutator._common.files import write_atomic
from mutator._common.hashing import digest
from mutator.store.checksummed_blocks import Block, BlockWriter, block_bytes, intact_blocks, read_blocks

PATCHES_FOLDER, PATCH_FILE_SUFFIX = "patches", ".blocks"
# kinds of blocks: a complete patch, or a difference from the last complete one
COMPLETE_BLOCK, DELTA_BLOCK = 0, 1
_DEFLATE_WINDOW_BYTES = 32_768  # window size of deflate, in bytes
_PATCHES_PER_COMPLETE = 256  # patches that depend on one complete patch, and are lost with it
_DEFLATE_LEVEL = 9  # patches are short, so that the best compression costs little time
MOST_PATCH_BYTES = 16_000_000  # when unpacked; a forged block can claim any size


class _PatchPacker:
    """Create the blocks of one file."""

    def __init__(self) -> None:
        self._packed_count = 0
        self._complete_end = b""

    def next_block(self, data: bytes) -> tuple[int, bytes]:
        """Return the kind and content of the block for the next patch."""
        is_complete = self._packed_count % _PATCHES_PER_COMPLETE == 0
        self._packed_count += 1
        if is_complete:
            self._complete_end = data[-_DEFLATE_WINDOW_BYTES:]
            return COMPLETE_BLOCK, zlib.compress(data, _DEFLATE_LEVEL)
        packer = zlib.compressobj(_DEFLATE_LEVEL, zdict=self._complete_end)
        return DELTA_BLOCK, packer.compress(data) + packer.flush()


class PatchWriter:
    """Append the patches of a worker."""

    def __init__(self, run: Path, worker: str) -> None:
        self._path = path_below(run / PATCHES_FOLDER, f"{worker}{PATCH_FILE_SUFFIX}")
        self._blocks: BlockWriter | None = None  # nothing appended yet
        self._packer = _PatchPacker()

    def append(self, experiment_id: str, data: bytes) -> None:
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        kind, content = self._packer.next_block(data)
        self._blocks.append(kind, experiment_id, content)

    def extend(self, blocks: bytes) -> None:
        """Append blocks that `pack_patches` returned."""
        if self._blocks is None:
            self._blocks = BlockWriter(self._path)
        self._blocks.extend(blocks)

    def sync(self) -> None:
        if self._blocks is not None:
            self._blocks.sync()

    def close(self) -> None:
        if self._blocks is not None:
            self._blocks.close()


class _CompletePatch:
    """A complete patch."""

    def __init__(self, block: Block) -> None:
        self._block = block

    @property
    def data(self) -> bytes:
        return decompress_bounded(self._block.data, MOST_PATCH_BYTES)

    @cached_property
    def delta_dictionary(self) -> bytes:
        """The part to which other patches refer."""
        return self.data[-_DEFLATE_WINDOW_BYTES:]


@dataclass(frozen=True, slots=True)
class _StoredPatch:
    """A patch's file and block, and the complete patch on which it depends (itself, if complete)."""

    path: Path
    block: Block
    complete: _CompletePatch | None


def _unpack_patch(block: Block, complete: _CompletePatch | None) -> bytes | None:
    """Return the patch in a block; None if it or the complete patch on which it depends is damaged."""
    try:
        if block.kind == COMPLETE_BLOCK or complete is None:
            return decompress_bounded(block.data, MOST_PATCH_BYTES)
        return decompress_bounded(block.data, MOST_PATCH_BYTES, complete.delta_dictionary)
    except (zlib.error, ValueError):
        return None


class PatchFolder:
    def __init__(self, run: Path) -> None:
        self.run = run

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(self._patches_by_experiment))

    def read_patch(self, experiment_id: str) -> bytes | None:
        """Return the newest patch of an experiment; None if it is missing or damaged."""
        patch = self._patches_by_experiment.get(experiment_id)
        return None if patch is None else _unpack_patch(patch.block, patch.complete)

    def experiment_digest_pairs(self) -> Iterator[tuple[str, str]]:
        """Yield each experiment that has a packed patch, and its SHA-256 (empty if damaged), oldest first."""
        for path in filter(Path.is_file, self.block_files()):
            complete: _CompletePatch | None = None
            for block in intact_blocks(path):
                complete = _CompletePatch(block) if block.kind == COMPLETE_BLOCK else complete
                data = _unpack_patch(block, complete)
                yield block.key, "" if data is None else digest(data)

    def expected_file_of(self, experiment_id: str, worker: str = "") -> Path:
        """Return the file that contains, or should contain, an experiment's patch.

        If the patch is not stored, return a damaged file; if none is damaged, the file of `worker`, if given,
        or else the folder.
        """
        patch = self._patches_by_experiment.get(experiment_id)
        if patch is not None:
            return patch.path
        damaged = (path for path in self.block_files() if not path.is_file() or read_blocks(path).is_damaged)
        expected_path = (
            path_below(self.run / PATCHES_FOLDER, f"{worker}{PATCH_FILE_SUFFIX}")
            if worker
            else self.run / PATCHES_FOLDER
        )
        return next(damaged, expected_path)

    def block_files(self) -> list[Path]:
        """Return the block files, oldest session first. A folder with such a name is included."""
        return sorted((self.run / PATCHES_FOLDER).glob(f"*{PATCH_FILE_SUFFIX}"))

    @cached_property
    def _patches_by_experiment(self) -> dict[str, _StoredPatch]:
        patches: dict[str, _StoredPatch] = {}
        for path in filter(Path.is_file, self.block_files()):  # never block on a pipe
            complete: _CompletePatch | None = None
            for block in read_blocks(path).blocks:
                if block.kind == COMPLETE_BLOCK:
                    complete = _CompletePatch(block)
                patches[block.key] = _StoredPatch(path, block, complete)
        return patches


def rewrite_patch_file(path: Path, patches: Iterable[tuple[str, bytes]]) -> None:
    write_atomic(path, pack_patches(patches))


def pack_patches(patches: Iterable[tuple[str, bytes]]) -> bytes:
    """Return patches as blocks that need no earlier blocks, for a whole file or a part of one."""
    packer, blocks = _PatchPacker(), []
    for experiment_id, data in patches:
        kind, content = packer.next_block(data)
        blocks.append(block_bytes(kind, experiment_id, content))
    return b"".join(blocks)
