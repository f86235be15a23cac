"""Compiles the slowest steps of a run's arithmetic: `python -m selfdrive.sim.compile_helpers [--cache DIR]`.

Later runs find them in the cache and give the same bytes in less time. Each is compared with the code that
it stands for before it is kept. Exit code 2 where there is no C compiler, or one that calculates otherwise.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np

from selfdrive.car.honda.interface import get_params
from selfdrive.common import compiled
from selfdrive.common.errors import ConfigError
from selfdrive.controls.lib.lateral_mpc import lateral_ocp
from selfdrive.controls.lib.long_mpc import long_ocp
from selfdrive.controls.lib.mpc_solver import condense, integrators_of, made_of
from selfdrive.sim.run import EXIT_INPUT
from selfdrive.sim.vision import DEFAULT_CACHE
from selfdrive.visiond.hog import C_SOURCE, CompiledHog, Hog

TRIALS = 100
SIZE = 112, 480  # rows and columns of a picture, those of the paper's detector and camera


def compile_helpers(cache: Path) -> Iterator[Path]:
    """Compile all helpers into the cache folder. Raises ConfigError, and keeps none that is not exact."""
    blocks = _blocks(Hog(*SIZE))
    yield compiled.make(
        cache,
        C_SOURCE.stem,
        C_SOURCE.read_bytes(),
        C_SOURCE.read_text(),
        lambda path: _blocks(CompiledHog(*SIZE, path)) == blocks,
    )
    for ocp in (long_ocp(), lateral_ocp(get_params().steer_rate_cost)):
        yield _compile(cache, ocp.name, condense(ocp, integrators_of(ocp)))


def _compile(cache: Path, name: str, function: ca.Function) -> Path:
    generator = ca.CodeGenerator(name)
    generator.add(function)
    outputs = _outputs(function)

    def exact(path: Path) -> bool:
        return _outputs(ca.external(function.name(), str(path))) == outputs

    return compiled.make(cache, name, made_of(function), generator.dump(), exact)


def _blocks(hog: Hog) -> list[bytes]:
    """Of noise, from the strongest to the faintest."""
    random = np.random.default_rng(0)
    noise = (random.integers(0, 256, SIZE, np.uint8) for _ in range(TRIALS))
    return [hog.blocks(picture >> (k % 8)).tobytes() for k, picture in enumerate(noise)]


def _outputs(function: ca.Function) -> list[bytes]:
    """For inputs around zero."""
    random = np.random.default_rng(0)
    sizes = [function.size1_in(k) for k in range(function.n_in())]
    trials = ([ca.DM(random.normal(0.0, 3.0, size)) for size in sizes] for _ in range(TRIALS))
    return [np.asarray(output).tobytes() for inputs in trials for output in function.call(inputs)]


def main() -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="selfdrive.sim.compile_helpers", description="Compile the slowest steps of a run's arithmetic."
    )
    parser.add_argument(
        "--cache", type=Path, default=DEFAULT_CACHE, metavar="DIR", help="where runs look for them"
    )
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
