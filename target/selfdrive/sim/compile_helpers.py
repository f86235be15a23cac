"""Compiles the slowest calculations: `python -m selfdrive.sim.compile_helpers`.

Installing the harness does the same. The exit code is 2 if there is no C compiler.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError, writing

PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
COMPILED_FOLDER = PACKAGE_FOLDER.with_name("compiled")
# Strict IEEE arithmetic: no fused multiply-add, no reordering. Without symbols, a library's bytes do not
# depend on the folder in which it is compiled.
COMPILER_OPTIONS = (
    "-O3",
    "-ffp-contract=off",
    "-fno-fast-math",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-std=c11",
    "-shared",
    "-fPIC",
    "-s",
    "-lm",
)
EXIT_INVALID_INPUT = 2


def compiler_command() -> list[str]:
    """The C compiler and its first options: CC, else cc, else that of the package ziglang, else []."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    if shutil.which("cc"):
        return ["cc"]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    return []


def compile_helpers(folder: Path) -> Iterator[Path]:
    """Compile every C file of the package into `folder` and remove outdated libraries. Raises ConfigError."""
    with writing(folder, expected="a folder for compiled helpers", remedy="choose another --out"):
        folder.mkdir(parents=True, exist_ok=True)
        sources = {compiled.file_name(source): source for source in sorted(PACKAGE_FOLDER.rglob("*.c"))}
        # A library is named by its sources' digest, so an older one would never be used again.
        for old in folder.glob(f"*{compiled.SUFFIX}"):
            if old.name not in sources:
                old.unlink()
        with TemporaryDirectory(dir=folder) as scratch:
            for name, source in sources.items():
                library = Path(scratch, name)
                _compile(source, library, scratch)
                data = library.read_bytes()
                library.write_bytes(data + sha256(data).digest())
                # Renaming is atomic: runs in other processes never load half a library.
                yield library.replace(folder / name)


def _compile(source: Path, library: Path, scratch: str) -> None:
    cache_folders = {"ZIG_LOCAL_CACHE_DIR": scratch, "ZIG_GLOBAL_CACHE_DIR": scratch}
    try:
        compiler_words = compiler_command()
        command = [*compiler_words, source, "-o", library, *COMPILER_OPTIONS]
        subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ | cache_folders)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"CC is {os.environ.get('CC', 'not set')!r}: {getattr(error, 'strerror', None) or error}",
            expected="a C compiler",
            remedy="install one or set CC; without one, runs only take longer",
        ) from None
    except subprocess.CalledProcessError as error:
        messages = error.stderr.strip().splitlines() or [f"exit status {error.returncode}"]
        raise ConfigError(
            f"{compiler_words[0]} says {messages[0]!r}",
            where=str(source),
            expected="a working C compiler",
            remedy="set CC to another one; without one, runs only take longer",
        ) from None


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.compile_helpers", description="Compile the slowest steps of a run's arithmetic."
    )
    parser.add_argument(
        "--out", type=Path, default=COMPILED_FOLDER, metavar="DIR", help="folder for the libraries"
    )
    try:
        for path in compile_helpers(parser.parse_args().out):
            print(path)
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INVALID_INPUT
    return 0


if __name__ == "__main__":
    sys.exit(main())
