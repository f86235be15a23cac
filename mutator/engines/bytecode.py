"""Write trees with bytecode that cannot be stale: imports compare each .pyc with the hash of its source.

An ordinary .pyc is trusted if the source's size and modification time match, so the pristine code could run
after a change that keeps the file's size.
"""

from collections.abc import Mapping
from importlib.util import cache_from_source
from pathlib import Path
from py_compile import PycInvalidationMode, PyCompileError, compile


def write_compiled(files: Mapping[str, bytes], dest: Path) -> None:
    """Write files (relative path -> content) to `dest`, with the bytecode of its Python files."""
    for name, data in files.items():
        path = dest / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        if path.suffix == ".py":
            _compile(path, name)


def put(files: Mapping[str, bytes], tree: Path) -> None:
    """Replace files (or links) of a tree and delete their bytecode."""
    for name, data in files.items():
        path = tree / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        path.write_bytes(data)
        if path.suffix == ".py":
            Path(cache_from_source(str(path))).unlink(missing_ok=True)


def _compile(path: Path, name: str) -> None:
    """Compile a file. Errors are ignored, because importing the file reports them."""
    try:
        compile(str(path), dfile=name, doraise=True, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
    except PyCompileError:
        return
