"""The solvers agree with other solvers on the same problems written out in full."""

import math
from array import array

import casadi as ca
import pytest
from selfdrive.controls.lib.lateral_mpc import FIRST_RATE
from selfdrive.controls.lib.lateral_ocp import lateral_ocp
from selfdrive.controls.lib.long_ocp import long_ocp
from selfdrive.controls.lib.mpc_iteration import Iteration
from selfdrive.controls.lib.mpc_solver import build_solver

LONG_START = (0.0, 20.0, -0.3, 40.0, 15.0, -1.0)
LONG_PARAM = (1.5,)
LATERAL_START = (2.0, 0.0, 0.01, 0.02)
LANES = (1e-5, -4e-4, 0.01, 2.1, 1e-5, -4e-4, 0.01, -1.5, 0.0, -4e-4, 0.02, 0.4)
LATERAL_PARAM = (0.23, 20.0, *LANES, 0.9, 0.7, 3.6)
CASES = {
    "longitudinal": (long_ocp(), LONG_START, LONG_PARAM, 0.0),
    "lateral": (lateral_ocp(0.5), LATERAL_START, LATERAL_PARAM, FIRST_RATE),
}


def full_problem(ocp, start, param):
    """Return trajectory, weighted residuals, dynamics defects and bounds, without eliminating variables."""
    n, nx = ocp.n_control, ocp.n_state
    w, p = ca.SX.sym("w", ocp.n_trajectory), ca.DM(param)
    z, u, q = ca.SX.sym("z", nx), ca.SX.sym("u"), ca.SX.sym("q", ocp.n_param)
    ode = ca.Function("ode", [z, ca.vertcat(u, q)], [ocp.ode(z, u, q)])
    residuals, defects = [], [w[:nx] - ca.DM(start)]
    low, high = [-math.inf] * ocp.n_trajectory, [math.inf] * ocp.n_trajectory
    for k in range(n + 1):
        node, last = w[nx * k : nx * (k + 1)], k == n
        control = 0 if last else w[nx * (n + 1) + k]
        stage, terminal = ocp.residuals(node, control, p)
        factor = 1.0 if last else ocp.intervals[k][1]
        weights = ocp.terminal_weights if last else ocp.weights
        residuals.append(ca.sqrt(factor * ca.DM(weights)) * (terminal if last else stage))
        if not last:
            steps = ocp.intervals[k][0]
            step = ca.simpleRK(ode, steps, 4)
            defects.append(
                step(node, ca.vertcat(control, p), steps * ocp.rk4_step) - w[nx * (k + 1) : nx * (k + 2)]
            )
            low[nx * (n + 1) + k], high[nx * (n + 1) + k] = -ocp.control_bound, ocp.control_bound
        for index, lo, hi in ocp.state_bounds if k else ():
            low[nx * k + index], high[nx * k + index] = lo, hi
    return w, ca.vertcat(*residuals), ca.vertcat(*defects), ca.DM(low), ca.DM(high)


def first_guess(ocp, start, control):
    nodes = [x + 0.01 * k for k in range(ocp.n_control + 1) for x in start]
    return array("d", nodes + [control] * ocp.n_control)


@pytest.mark.parametrize("case", CASES)
def test_one_iteration_is_the_full_gauss_newton_step(case):
    ocp, start, param, control = CASES[case]
    w, residuals, defects, low, high = full_problem(ocp, start, param)
    guess = first_guess(ocp, start, control)
    evaluate = ca.Function("f", [w], [residuals, ca.jacobian(residuals, w), defects, ca.jacobian(defects, w)])
    r, jacobian, d, defects_by_w = evaluate(ca.DM(guess))
    hessian = jacobian.T @ jacobian
    qp = ca.conic(
        "qp",
        "qrqp",
        {"h": hessian.sparsity(), "a": defects_by_w.sparsity()},
        {"print_iter": False, "print_header": False, "print_info": False},
    )
    bounds = {"lba": -d, "uba": -d, "lbx": low - ca.DM(guess), "ubx": high - ca.DM(guess)}
    wanted = ca.DM(guess) + qp(h=hessian, g=jacobian.T @ r, a=defects_by_w, **bounds)["x"]

    iteration = Iteration(build_solver(ocp))
    iteration.guess[:] = guess
    assert iteration.run(start, param)
    assert iteration.unsolved == 0
    assert list(iteration.solution) == pytest.approx(list(wanted.full().ravel()), abs=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_iterations_converge_to_the_optimum(case):
    ocp, start, param, control = CASES[case]
    w, residuals, defects, low, high = full_problem(ocp, start, param)
    nlp = {"x": w, "f": ca.sumsqr(residuals) / 2, "g": defects}
    solver = ca.nlpsol(
        "nlp", "ipopt", nlp, {"ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}, "print_time": False}
    )
    wanted = solver(x0=ca.DM(first_guess(ocp, start, control)), lbg=0, ubg=0, lbx=low, ubx=high)["x"]

    iteration = Iteration(build_solver(ocp))
    iteration.guess[:] = first_guess(ocp, start, control)
    for _ in range(30):
        assert iteration.run(start, param)
        iteration.guess[:] = iteration.solution
    assert list(iteration.solution) == pytest.approx(list(wanted.full().ravel()), abs=2e-4)


@pytest.mark.parametrize("case", CASES)
def test_equal_input_gives_equal_bytes(case):
    ocp, start, param, control = CASES[case]
    guess = first_guess(ocp, start, control)
    solver = build_solver(ocp)

    def run(iteration):
        iteration.guess[:] = guess
        assert iteration.run(start, param)
        return iteration.solution.tobytes() + iteration.guess.tobytes()

    iteration = Iteration(solver)
    wanted = run(iteration)
    iteration.run(tuple(x + 1.0 for x in start), param)
    iteration.run((math.nan,) * len(start), param)
    iteration.run(start, (math.inf,) * len(param))
    iteration.run((0.0, -1e9, 3.0, *start[3:]), param)
    assert run(iteration) == wanted
    assert run(Iteration(solver)) == wanted
    assert run(Iteration(build_solver(ocp))) == wanted


def test_an_infeasible_program_is_solved_without_the_bounds_of_states():
    """From 60 degrees, the wheels turn back as fast as allowed, although 25 degrees cannot be reached."""
    ocp, _, param, _ = CASES["lateral"]
    iteration = Iteration(build_solver(ocp))
    beyond = (0.0, 0.0, 0.0, math.radians(60.0))
    iteration.restart(control=0.05)
    assert iteration.run(beyond, param)
    assert iteration.unsolved == 1
    assert iteration.solution[4 * 21] == pytest.approx(-0.1)
    assert iteration.solution[3] == beyond[3]


def test_shift_moves_the_guess_by_one_interval():
    ocp, start, param, control = CASES["lateral"]
    iteration = Iteration(build_solver(ocp))
    iteration.restart(control=control)
    iteration.run(start, param)
    new, following = iteration.solution, iteration.guess
    assert following[: 4 * 20] == new[4 : 4 * 21]
    assert following[84:103] == new[85:104]
    assert following[103] == new[103]
    assert following[83] == pytest.approx(new[83] + 0.15 * new[103], abs=1e-12)


def test_the_longitudinal_guess_is_not_shifted():
    ocp, start, param, _ = CASES["longitudinal"]
    iteration = Iteration(build_solver(ocp))
    iteration.restart()
    iteration.run(start, param)
    assert iteration.guess == iteration.solution
