"""Write trees with bytecode that cannot be stale: imports compare each .pyc with the hash of its source.

An ordinary .pyc is trusted if the source's size and modification time match, so the pristine code could run
after a change that keeps the file's size.
"""

import marshal
import sys
from collections.abc import Iterable, Mapping
from importlib.util import MAGIC_NUMBER, source_hash
from pathlib import Path
from typing import NamedTuple

from mutator.engines.imported_files import ModuleNames, files_imported_by, module_names_in
from mutator.targets.source_tree import SourceTree

# flags of a .pyc file (PEP 552): it has a hash of its source, and imports check it
_CHECKED_HASH_FLAGS = (0b11).to_bytes(4, "little")


class _CompiledFile(NamedTuple):
    pyc: bytes  # empty if the file does not compile
    names: ModuleNames


def files_with_bytecode(tree: SourceTree, entry_module: str) -> dict[str, bytes]:
    """Return the files of a tree (relative path -> content), and the bytecode of those that a run imports.

    Compiling is most of the work for a large tree, of which a run loads few files.
    """
    python_files = (name for name in tree.files if name.endswith(".py"))
    files = dict(tree.files)
    for name in files_imported_by(python_files, entry_module, lambda path: _compiled(tree, path).names):
        if pyc := _compiled(tree, name).pyc:
            files[bytecode_path(name)] = pyc
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


def _compiled(tree: SourceTree, name: str) -> _CompiledFile:
    return tree.derive_once(name, _compile_file, with_defence_lines=True)


def _compile_file(name: str, data: bytes, _: Path) -> _CompiledFile:
    """Compile a file. Errors are ignored, because importing the file reports them."""
    try:
        code = compile(data, name, "exec", dont_inherit=True, optimize=0)
    except Exception:
        return _CompiledFile(b"", ModuleNames(frozenset(), frozenset()))
    pyc = MAGIC_NUMBER + _CHECKED_HASH_FLAGS + source_hash(data) + marshal.dumps(code)
    return _CompiledFile(pyc, module_names_in(code))
