"""The compiled solvers return the same bits as CasADi's, or CasADi's solvers are used instead."""

import ctypes
import math
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import casadi
import pytest
from selfdrive.common import compiled
from selfdrive.controls.lib import compiled_mpc, generate_mpc_header
from selfdrive.controls.lib.compiled_mpc import CompiledSolver, build_lateral, build_longitudinal
from selfdrive.controls.lib.lateral_mpc import FIRST_RATE
from selfdrive.controls.lib.lateral_ocp import lateral_ocp
from selfdrive.controls.lib.long_ocp import long_ocp
from selfdrive.controls.lib.mpc_iteration import Iteration, Solver
from selfdrive.controls.lib.mpc_solver import build_solver
from selfdrive.sim.compile_helpers import compiler_command

RATE_COST = 0.5
REFERENCES = {
    "longitudinal": lambda: build_solver(long_ocp()),
    "lateral": lambda: build_solver(lateral_ocp(RATE_COST)),
}
COMPILED = {"longitudinal": build_longitudinal, "lateral": lambda: build_lateral(RATE_COST)}
NO_NUMBERS = (math.nan, math.inf, -math.inf, 1e300, -1e9)

pytestmark = pytest.mark.skipif(not compiler_command(), reason="there is no C compiler")


@pytest.fixture
def use(all_compiled: Path) -> Iterator[None]:
    compiled.use_libraries_in(all_compiled)
    yield
    compiled.use_libraries_in(None)


@pytest.fixture(scope="module")
def references() -> dict[str, Solver]:
    return {name: build() for name, build in REFERENCES.items()}


def number(draw: random.Random, scale: float) -> float:
    return draw.choice((0.0, draw.uniform(-scale, scale), draw.gauss(0.0, scale)))


def problem(name: str, draw: random.Random, wild: float) -> tuple[list[float], list[float]]:
    """Return an initial state and parameters, `wild` times as large as in a normal drive."""
    if name == "longitudinal":
        speeds = [abs(number(draw, 30 * wild)) for _ in range(2)]
        gap = draw.choice((50.0, abs(number(draw, 100 * wild))))
        start = [0.0, speeds[0], number(draw, 3 * wild), gap, speeds[1], number(draw, 3 * wild)]
        return start, [draw.choice((1.5, draw.uniform(0.0, 3 * wild)))]
    sizes = (1e-5 * wild, 1e-3 * wild, 0.05 * wild)
    lines = [[*(number(draw, size) for size in sizes), y + number(draw, wild)] for y in (1.85, -1.85, 0.0)]
    start = [abs(number(draw, 3 * wild)), 0.0, number(draw, 0.05 * wild), number(draw, 0.05 * wild)]
    car = [draw.uniform(0.1, 0.4) * wild, draw.uniform(5.0, 35.0) * wild]
    return start, [*car, *chain(*lines), draw.random(), draw.random(), 3.7]


def spoil(values: list[float], draw: random.Random) -> None:
    if draw.random() < 0.03:
        values[draw.randrange(len(values))] = draw.choice(NO_NUMBERS)


@pytest.mark.usefixtures("use")
@pytest.mark.parametrize("name", REFERENCES)
@pytest.mark.parametrize("seed", range(40))
def test_compiled_iterations_have_the_same_bits_as_casadi(
    name: str, seed: int, references: dict[str, Solver]
) -> None:
    """Results that are not finite are considered equal."""
    draw = random.Random(seed)
    wild = draw.choice((1.0, 3.0, 10.0, 1e3, 1e10, 1e100, 1e308)) if seed % 4 == 0 else 1.0
    solver = COMPILED[name]()
    assert isinstance(solver, CompiledSolver)
    ours, theirs = Iteration(solver), Iteration(references[name])
    control = FIRST_RATE if name == "lateral" else 0.0
    guess = [wild * number(draw, 5.0) for _ in theirs.guess]
    for one in (ours, theirs):
        one.restart(control=control)
        if seed % 3 == 0:
            one.guess[:] = type(one.guess)("d", guess)
    for _ in range(15):
        start, parameters = problem(name, draw, wild)
        spoil(start, draw)
        spoil(parameters, draw)
        if name == "longitudinal":
            for one in (ours, theirs):
                one.guess[: len(start)] = type(one.guess)("d", start)
        finite = theirs.run(start, parameters)
        assert ours.run(start, parameters) == finite
        assert ours.unsolved == theirs.unsolved
        if finite:
            assert ours.solution.tobytes() == theirs.solution.tobytes()
            assert ours.guess.tobytes() == theirs.guess.tobytes()
        else:
            ours.restart(control=control)
            theirs.restart(control=control)


@pytest.mark.usefixtures("use")
@pytest.mark.parametrize("name", COMPILED)
def test_a_solvers_result_does_not_depend_on_earlier_problems(name: str) -> None:
    draw = random.Random(1)
    start, parameters = problem(name, draw, 1.0)
    solver = COMPILED[name]()

    def run(iteration: Iteration) -> bytes:
        iteration.restart()
        assert iteration.run(start, parameters)
        return iteration.solution.tobytes() + iteration.guess.tobytes()

    iteration = Iteration(solver)
    wanted = run(iteration)
    for bad in NO_NUMBERS:
        iteration.run([bad] * len(start), parameters)
        iteration.run(start, [bad] * len(parameters))
        iteration.run([*start[:-1], bad], parameters)
    assert run(iteration) == run(Iteration(solver)) == run(Iteration(COMPILED[name]())) == wanted


@pytest.mark.usefixtures("use")
@pytest.mark.parametrize(("slope", "y"), [(100.0, -300.0), (1.0, -300.0), (0.5, -30.0), (0.0, -50.0)])
def test_what_daqp_left_from_an_earlier_problem_is_no_solution(
    slope: float, y: float, references: dict[str, Solver]
) -> None:
    """DAQP gives up on lanes so far away; CasADi then returns the results of the call before, here NaN."""
    results = []
    for solver in (build_lateral(RATE_COST), references["lateral"]):
        iteration = Iteration(solver)
        for first_slope in (math.nan, slope):
            lines = [value for line in (y, y - 3.7, y - 1.85) for value in (0.0, 0.0, first_slope, line)]
            iteration.restart(control=FIRST_RATE)
            iteration.run((2.1, 0.0, 0.007, 0.015), (0.229, 21.0, *lines, 1.0, 1.0, 3.7))
        results.append((iteration.unsolved, iteration.solution.tobytes(), iteration.guess.tobytes()))
    assert results[0] == results[1]
    assert results[0][0] == 1


def test_the_generated_header_is_current() -> None:
    assert casadi.__version__ == compiled_mpc.CASADI_VERSION
    assert generate_mpc_header.HEADER_PATH.read_text() == generate_mpc_header.render_header()
    assert long_ocp().weights == compiled_mpc.LONGITUDINAL_WEIGHTS
    assert lateral_ocp(RATE_COST).weights == (*compiled_mpc.LATERAL_WEIGHTS, RATE_COST)


@pytest.mark.usefixtures("use")
@pytest.mark.parametrize("other", ["version", "function", "conduct"])
def test_the_library_is_not_used_with_another_version_of_daqp(
    other: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled_mpc._find_daqp.cache_clear()
    if other == "version":
        monkeypatch.setattr(compiled_mpc, "CASADI_VERSION", "3.7.0")
    elif other == "function":
        monkeypatch.setattr(ctypes, "CDLL", lambda path: object())
    else:
        nothing = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 3)(lambda *_: None)
        monkeypatch.setattr(compiled_mpc, "_find_daqp", lambda: ctypes.cast(nothing, ctypes.c_void_p))
    found = compiled_mpc._load_code()
    monkeypatch.undo()
    compiled_mpc._find_daqp.cache_clear()
    assert found is None and compiled_mpc._load_code() is not None


@pytest.mark.parametrize(
    "edited", ["mpc.c", "mpc_generated.h", "mpc_solver.py", "long_ocp.py", "lateral_ocp.py", "horizon.py"]
)
def test_an_edited_problem_is_solved_by_casadi(all_compiled: Path, tmp_path: Path, edited: str) -> None:
    target = tmp_path / "target"
    shutil.copytree(
        generate_mpc_header.HEADER_PATH.parents[3] / "selfdrive",
        target / "selfdrive",
        ignore=shutil.ignore_patterns("*.pyc"),
    )
    path = target / "selfdrive/controls/lib" / edited
    path.write_text(path.read_text() + "\n")
    code = (
        "from pathlib import Path; from selfdrive.common import compiled; "
        "compiled.use_libraries_in(Path(%r)); "
        "from selfdrive.controls.lib.compiled_mpc import *; "
        "print(type(build_lateral(0.5)).__name__, type(build_longitudinal()).__name__)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code % str(all_compiled)],
        cwd=target,
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.split() == ["Function", "Function"]


def test_a_compiled_run_without_frames_does_not_import_casadi(all_compiled: Path) -> None:
    """Importing CasADi is slow."""
    code = (
        "import sys; from selfdrive.sim.run import open_run; "
        "open_run(['--scenario', %r, '--out', 'none', '--compiled', %r]).step(); "
        "print([name for name in ('casadi', 'cv2', 'skimage') if name in sys.modules])"
    )
    root = generate_mpc_header.HEADER_PATH.parents[3]
    scenario = root.parent / "fault_library/scenarios/S1.yaml"
    command = [sys.executable, "-c", code % (str(scenario), str(all_compiled))]
    ran = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"
