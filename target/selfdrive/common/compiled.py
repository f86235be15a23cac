"""C libraries that do a part of a run's arithmetic: the same numbers, sooner. Nothing needs them.

A library lies in a folder of the cache under a digest of its C source and of how it is compiled, so one that
was made of something else is never taken. `selfdrive.sim.compile_helpers` makes them; runs only look.
"""

import ctypes
import os
import platform
import shlex
import subprocess
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

from selfdrive.common.errors import ConfigError, writing

FOLDER = "compiled"
# IEEE arithmetic as it is written: no fused multiply-add, no other order, no flags for one processor alone.
OPTIONS = ("-O3", "-ffp-contract=off", "-fno-fast-math", "-std=c99", "-shared", "-fPIC", "-lm")

_folder: Path | None = None


def use(cache: Path | None) -> None:
    """From now on look for libraries in this cache folder; None: do without."""
    global _folder
    _folder = None
    if cache is not None and os.name == "posix":
        try:
            folder = cache.expanduser() / FOLDER
        except RuntimeError:  # a home that nobody knows
            return
        _folder = folder if folder.is_dir() else None


def in_use() -> bool:
    """Whether there may be a library: only then is it worth while to find out what it would be made of."""
    return _folder is not None


def library(name: str, made_of: bytes) -> Path | None:
    """The library `name` of what `made_of` stands for; None if there is none, or none is to be used.

    One that cannot be loaded here, as it was made with another C library, is none.
    """
    if _folder is None:
        return None
    path = _folder / _file(name, made_of)
    try:
        ctypes.CDLL(str(path))
    except OSError:
        return None
    return path


def make(cache: Path, name: str, made_of: bytes, source: str, exact: Callable[[Path], bool]) -> Path:
    """Compile C `source` for `library` to find it, once `exact` has said that the library may be kept.

    Raises ConfigError where it may not, or where there is none.
    """
    folder = cache.expanduser() / FOLDER
    with writing(folder, expected="a folder for compiled helpers", remedy="choose another --cache"):
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder) as scratch:
            code, made = Path(scratch, f"{name}.c"), Path(scratch, f"{name}.so")
            code.write_text(source)
            _run(os.environ.get("CC") or "cc", code, made)
            if not exact(made):
                raise ConfigError(
                    f"compiled, {name} gives other numbers",
                    expected="those of the code it stands for, to the last bit",
                    remedy="set CC to another compiler, or go on without: runs only take longer",
                )
            return made.replace(folder / _file(name, made_of))


def _run(compiler: str, code: Path, made: Path) -> None:
    try:
        subprocess.run(
            [*shlex.split(compiler), str(code), "-o", str(made), *OPTIONS],
            check=True,
            capture_output=True,
            text=True,
        )
    except FileNotFoundError:
        raise ConfigError(
            f"{compiler!r} is not there",
            expected="a C compiler",
            remedy="install one or set CC, or go on without: runs only take longer",
        ) from None
    except subprocess.CalledProcessError as error:
        words = error.stderr.strip().splitlines() or [f"exit status {error.returncode}"]
        raise ConfigError(
            f"{compiler!r} says {words[0]!r}", expected="a working C compiler", remedy="set CC to another one"
        ) from None


def _file(name: str, made_of: bytes) -> str:
    how = repr((OPTIONS, platform.system(), platform.machine())).encode()
    return f"{name}-{sha256(how + made_of).hexdigest()[:32]}.so"
