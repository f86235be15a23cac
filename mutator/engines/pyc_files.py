"""Write trees with bytecode that cannot be stale: imports compare each .pyc with the hash of its source.

An ordinary .pyc is trusted if the source's size and modification time match, so the pristine code could run
after a change that keeps the file's size.
"""

import marshal
import sys
from collections.abc import Iterable, Mapping
from importlib.util import MAGIC_NUMBER, source_hash
from pathlib import Path

from mutator.targets.source_tree import SourceTree

# flags of a .pyc file (PEP 552): it has a hash of its source, and imports check it
_CHECKED_HASH_FLAGS = (0b11).to_bytes(4, "little")


def files_with_bytecode(tree: SourceTree) -> dict[str, bytes]:
    """Return the files of a tree (relative path -> content) and the bytecode of its Python files."""
    files = dict(tree.files)
    for name in tree.files:
        if name.endswith(".py") and (code := tree.derive_once(name, _compile_to_pyc)):
            files[bytecode_path(name)] = code
    return files


def bytecode_path(name: str) -> str:
    """Return the path of a Python file's bytecode."""
    path = Path(name)
    return str(path.parent / "__pycache__" / f"{path.stem}.{sys.implementation.cache_tag}.pyc")


def write_files(files: Mapping[str, bytes], dest: Path) -> None:
    """Write files to the folder `dest`, which can exist."""
    # as a set, because most files share few folders
    for folder in {dest, *((dest / name).parent for name in files)}:
        folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (dest / name).write_bytes(data)


def replace_dropping_bytecode(files: Mapping[str, bytes], tree: Path) -> None:
    """Replace files of a tree and delete their bytecode."""
    remove_files((*files, *map(bytecode_path, files)), tree)
    write_files(files, tree)


def remove_files(names: Iterable[str], tree: Path) -> None:
    for name in names:
        (tree / name).unlink(missing_ok=True)


def _compile_to_pyc(name: str, data: bytes, _: Path) -> bytes:
    """Compile a file. Errors are ignored, because importing the file reports them."""
    try:
        code = compile(data, name, "exec", dont_inherit=True, optimize=0)
    except Exception:
        return b""
    return MAGIC_NUMBER + _CHECKED_HASH_FLAGS + source_hash(data) + marshal.dumps(code)
