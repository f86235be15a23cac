"""Compiles the slowest steps of a run's arithmetic: `python -m selfdrive.sim.compile_helpers --cache DIR`.

Later runs with that cache find them there and give the same bytes in less time. Each is compared with the
code that it stands for before it is kept. Exit code 2 where there is no C compiler, or one that calculates
otherwise.
"""

import argparse
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
import numpy as np

from selfdrive.car.honda.interface import get_params
from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError, writing
from selfdrive.controls.lib.lateral_mpc import lateral_ocp
from selfdrive.controls.lib.long_mpc import long_ocp
from selfdrive.controls.lib.mpc_solver import condense, integrators_of, made_of
from selfdrive.sim.run import EXIT_INPUT
from selfdrive.visiond import compiled_hog
from selfdrive.visiond.compiled_hog import C_SOURCE, CompiledHog
from selfdrive.visiond.hog import Hog

# IEEE arithmetic as it is written: no fused multiply-add, no other order.
OPTIONS = ("-O3", "-ffp-contract=off", "-fno-fast-math", "-std=c99", "-shared", "-fPIC", "-lm")
TRIALS = 100
SIZE = 112, 480  # rows and columns of a picture, those of the paper's detector and camera
GO_ON = "or go on without: runs only take longer"


def compiler() -> list[str]:
    """The C compiler, CC or cc, and the options that it is given there."""
    return shlex.split(os.environ.get("CC", "")) or ["cc"]


def compile_helpers(cache: Path) -> Iterator[Path]:
    """Compile all helpers into the cache folder. Raises ConfigError, and keeps none that is not exact."""
    blocks = _blocks(Hog(*SIZE))

    def exact_blocks(library: compiled.Library) -> bool:
        return _blocks(CompiledHog(*SIZE, library)) == blocks

    yield make(cache, C_SOURCE.stem, compiled_hog.made_of(), C_SOURCE.read_text(), exact_blocks)
    for ocp in (long_ocp(), lateral_ocp(get_params().steer_rate_cost)):
        yield _compile(cache, ocp.name, condense(ocp, integrators_of(ocp)))


def make(
    cache: Path, name: str, made_of: bytes, source: str, exact: Callable[[compiled.Library], bool]
) -> Path:
    """Compile C `source` for `compiled.library` to find it, once `exact` has said that it may be kept.

    Raises ConfigError where it may not, or cannot be made.
    """
    folder = cache / compiled.FOLDER
    with writing(folder, expected="a folder for compiled helpers", remedy="choose another --cache"):
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder) as scratch:
            code, made = Path(scratch, f"{name}.c"), Path(scratch, f"{name}{compiled.SUFFIX}")
            code.write_text(source)
            _run(code, made)
            data = made.read_bytes()
            digest = sha256(data).digest()
            if not exact(compiled.Library(made, digest)):
                raise ConfigError(
                    f"compiled, {name} gives other numbers",
                    expected="those of the code it stands for, to the last bit",
                    remedy=f"set CC to another compiler, {GO_ON}",
                )
            whole = made.with_suffix(".whole")
            whole.write_bytes(data + digest)
            return whole.replace(folder / compiled.file_name(name, made_of))


def _run(code: Path, made: Path) -> None:
    try:
        words = compiler()
        subprocess.run([*words, code, "-o", made, *OPTIONS], check=True, capture_output=True, text=True)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"CC is {os.environ.get('CC', 'not set')!r}: {getattr(error, 'strerror', None) or error}",
            expected="a C compiler",
            remedy=f"install one or set CC, {GO_ON}",
        ) from None
    except subprocess.CalledProcessError as error:
        said = error.stderr.strip().splitlines() or [f"exit status {error.returncode}"]
        raise ConfigError(
            f"{words[0]} says {said[0]!r}",
            expected="a working C compiler",
            remedy=f"set CC to another one, {GO_ON}",
        ) from None


def _compile(cache: Path, name: str, function: ca.Function) -> Path:
    generator = ca.CodeGenerator(name)
    generator.add(function)
    expected = outputs(function)

    def exact(library: compiled.Library) -> bool:
        return outputs(ca.external(function.name(), str(library.path))) == expected

    return make(cache, name, made_of(function), generator.dump(), exact)


def _blocks(hog: Hog) -> list[bytes]:
    """Of noise, from the strongest to the faintest."""
    random = np.random.default_rng(0)
    noise = (random.integers(0, 256, SIZE, np.uint8) for _ in range(TRIALS))
    return [hog.blocks(picture >> (k % 8)).tobytes() for k, picture in enumerate(noise)]


def outputs(function: ca.Function) -> list[bytes]:
    """For small inputs, none of them negative: speeds are among them, and a root is taken of these."""
    random = np.random.default_rng(0)
    sizes = [function.size1_in(k) for k in range(function.n_in())]
    trials = ([ca.DM(abs(random.normal(0.0, 1.0, size))) for size in sizes] for _ in range(TRIALS))
    return [np.asarray(output).tobytes() for inputs in trials for output in function.call(inputs)]


def main() -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.compile_helpers", description="Compile the slowest steps of a run's arithmetic."
    )
    parser.add_argument("--cache", type=Path, required=True, metavar="DIR", help="where runs look for them")
    options = parser.parse_args()
    try:
        for path in compile_helpers(options.cache):
            print(f"{path}: the same numbers in {TRIALS} trials")
    except ConfigError as error:
        print(f"error: {error}", file=sys.stderr)
        return EXIT_INPUT
    return 0


if __name__ == "__main__":
    sys.exit(main())
