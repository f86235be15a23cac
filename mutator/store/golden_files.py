"""The files of golden runs in a folder `golden`: each run has a folder or, if it is of a family, is packed.

A packed run is the file `<key>.packed`, with a block for each of its output files. This module is the only
reader and writer of packed runs.
"""

import shutil
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_relative_path, path_below
from mutator._common.files import ScratchFolder, raising_disk_full, write_atomic
from mutator.errors import MutatorError
from mutator.store.checksummed_blocks import block_bytes, read_blocks
from mutator.store.trace_packing import pack_file, unpack_file

GOLDEN_FOLDER, PACKED_SUFFIX = "golden", ".packed"  # `allowed_contents` and `file_digests` name them, too
_OUTPUT_FILE_BLOCK = 0  # the kind of the blocks
MOST_UNPACKED = 40  # runs that are unpacked at a time, of 0.6 MB each: more than a worker keeps in memory


class GoldenFolders:
    """Finds the output of golden runs. The `most_unpacked` packed ones that were used last are unpacked into
    temporary folders in `scratch_folder` (None: the system's).
    """

    def __init__(self, scratch_folder: Path | None = None, most_unpacked: int = MOST_UNPACKED) -> None:
        self._scratch_folder, self._most_unpacked = scratch_folder, most_unpacked
        self._unpacked: OrderedDict[tuple[Path, int, int, int], ScratchFolder] = OrderedDict()

    def output_folder(self, golden: Path, key: str) -> Path:
        """Return a folder with the output of a run, for reading only. It is missing if the run is.

        That of a packed run is deleted when this process has used many others since, or ends.
        """
        stored = stored_golden(golden, key)
        return self._unpacked_folder(stored) if stored.is_file() else stored

    def _unpacked_folder(self, packed: Path) -> Path:
        state = packed.stat()
        key = (packed, state.st_ino, state.st_size, state.st_ctime_ns)
        if key not in self._unpacked:
            self._unpacked[key] = self._unpack(packed)
            if len(self._unpacked) > self._most_unpacked:
                self._unpacked.popitem(last=False)  # its folder is deleted with it
        self._unpacked.move_to_end(key)
        return self._unpacked[key].path

    def _unpack(self, packed: Path) -> ScratchFolder:
        files = _unpacked_files(packed)
        scratch = ScratchFolder("mutator-golden-", self._scratch_folder)
        with raising_disk_full(scratch.path):
            for name, data in files.items():
                path = path_below(scratch.path, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(data)
        return scratch


_folders_of_readers = GoldenFolders()


def _unpacked_files(packed: Path) -> Mapping[str, bytes]:
    """Return the content of each file of a packed run by name; MutatorError if any is damaged."""
    block_file = read_blocks(packed)
    try:
        if block_file.is_damaged or not block_file.blocks:
            raise ValueError("a damaged block")
        return {
            checked_relative_path(block.key, packed): unpack_file(block.data) for block in block_file.blocks
        }
    except ValueError as err:
        raise MutatorError(
            f"a damaged golden run ({err})",
            where=packed,
            expected="a packed golden run, as it was written",
            remedy=f"set the damage aside with `mutator verify {packed.parent.parent} --repair`, then fill "
            "the gap with `mutator run`",
        ) from None


def pack_golden(output: Path, golden: Path, key: str) -> None:
    """Pack the regular files of an output folder as a run in the folder `golden`."""
    paths = sorted(path for path in output.rglob("*") if path.is_file() and not path.is_symlink())
    blocks = [
        block_bytes(_OUTPUT_FILE_BLOCK, path.relative_to(output).as_posix(), pack_file(read_bounded(path)))
        for path in paths
    ]
    golden.mkdir(parents=True, exist_ok=True)
    write_atomic(_packed_path(golden, key), b"".join(blocks))


def stored_golden(golden: Path, key: str) -> Path:
    """Return the packed file of a run in the folder `golden`, or else its folder, which can be missing."""
    packed = _packed_path(golden, key)
    return packed if packed.is_file() else path_below(golden, key)


def copy_golden(golden: Path, key: str, destination: Path) -> Path:
    """Copy a run into the folder `destination`, as it is stored; return the copy."""
    stored = stored_golden(golden, key)
    destination.mkdir(parents=True, exist_ok=True)
    copy = path_below(destination, stored.name)
    if stored.is_file():
        shutil.copy(stored, copy)
    else:
        shutil.copytree(stored, copy)
    return copy


def move_golden(stored: Path, golden: Path) -> None:
    """Move what `stored_golden` has found to the folder `golden` on the same disk, over an earlier one."""
    golden.mkdir(parents=True, exist_ok=True)
    destination = path_below(golden, stored.name)
    if not stored.is_file():
        shutil.rmtree(destination, ignore_errors=True)
    stored.rename(destination)


def stored_golden_keys(golden: Path) -> list[str]:
    """Return the keys of the runs in the folder `golden`, sorted."""
    return sorted(
        path.name.removesuffix(PACKED_SUFFIX) if path.is_file() else path.name for path in golden.glob("*")
    )


def list_golden_files(stored: Path) -> list[Path]:
    """Return the files of a run that `stored_golden` has found."""
    return [stored] if stored.is_file() else sorted(path for path in stored.rglob("*") if path.is_file())


def golden_output_folder(golden: Path, key: str) -> Path:
    """Like `GoldenFolders.output_folder`, for whoever only reads a run folder."""
    return _folders_of_readers.output_folder(golden, key)


def read_golden_files(golden: Path, key: str) -> Mapping[str, bytes]:
    """Return the content of each file of a run, by name; empty if the run is missing. MutatorError if its
    packed form is damaged.
    """
    stored = stored_golden(golden, key)
    if stored.is_file():
        return _unpacked_files(stored)
    return {path.relative_to(stored).as_posix(): read_bounded(path) for path in list_golden_files(stored)}


def _packed_path(golden: Path, key: str) -> Path:
    return path_below(golden, f"{key}{PACKED_SUFFIX}")
