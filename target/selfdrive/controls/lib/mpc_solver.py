"""One real-time iteration of nonlinear model-predictive control, built with CasADi.

As in ACADO's generated code, which the original controller used: multiple shooting with RK4, Gauss-Newton
Hessian, states eliminated (condensing), one quadratic program, full step. DAQP is set up in every call, so a
solver is stateless.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

FEASIBILITY_TOL = 1e-3  # in the units of the bounds; DAQP's own tolerance is 1e-6 of its scaled rows
STATIONARITY_TOL = 1e-6  # relative to the gradient
SWEEPS = 100  # of the fallback; a problem with lanes 30 m away needs 73
LARGEST = 1e100  # largest square sum of a meaningful trajectory
LARGEST_GRADIENT = 1e300

Bounds = tuple[tuple[int, float, float], ...]  # (index of the state, lowest, highest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ocp:
    """An optimal control problem with one control: least squares over N intervals.

    `ode(z, u, p)` returns the CasADi expression of the state's derivative, `residuals(z, u, p)` those of the
    stage and terminal costs. `intervals` has (number of RK4 steps, factor on the weights).
    """

    name: str
    n_state: int
    n_param: int
    rk4_step: float  # s
    intervals: tuple[tuple[int, float], ...]
    ode: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
    residuals: Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]
    weights: tuple[float, ...]
    terminal_weights: tuple[float, ...]
    state_bounds: Bounds
    control_bound: float = math.inf  # on both sides
    linear: bool = False  # the ode is linear in state and control
    shift: bool = False  # start the next iteration one interval later

    @property
    def n_control(self) -> int:
        return len(self.intervals)

    @property
    def n_trajectory(self) -> int:
        return self.n_state * (self.n_control + 1) + self.n_control


def rk4(ocp: Ocp) -> ca.Function:
    """One RK4 step: (state, control, p) -> (next state, its Jacobians for state and control)."""
    z, u, p, h = ca.SX.sym("z", ocp.n_state), ca.SX.sym("u"), ca.SX.sym("p", ocp.n_param), ocp.rk4_step
    k1 = ocp.ode(z, u, p)
    k2 = ocp.ode(z + h / 2 * k1, u, p)
    k3 = ocp.ode(z + h / 2 * k2, u, p)
    k4 = ocp.ode(z + h * k3, u, p)
    end = z + h / 6 * (k1 + 2 * (k2 + k3) + k4)
    return ca.Function("rk4", [z, u, p], ca.cse([end, ca.jacobian(end, z), ca.jacobian(end, u)]))


def _integrator(ocp: Ocp, step: ca.Function, n_steps: int) -> ca.Function:
    """`n_steps` RK4 steps: (state and control, p) -> (next state, its Jacobian)."""
    zu, p = ca.SX.sym("zu", ocp.n_state + 1), ca.SX.sym("p", ocp.n_param)
    end, m = zu[:-1], ca.SX.eye(ocp.n_state + 1)[:-1, :]
    for _ in range(n_steps):
        end, a, b = step(end, zu[-1], p)
        m = a @ m
        m[:, -1] += b
    return ca.Function("integrate", [zu, p], [end, m])


def _gauss_newton(r: ca.SX, zu: ca.SX, change: ca.SX, weights: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Hessian and gradient of a cost for state and control; the gradient is after `change` of the state."""
    c = ca.jacobian(r, zu)
    cw = c.T @ ca.diag(weights)
    return cw @ c, cw @ (r + c[:, :-1] @ change)


def _backward(ocp: Ocp) -> tuple[ca.Function, ca.Function]:
    """Two functions for the Hessian and gradient of all costs from a node on, with respect to its state.

    At the last node: (state, p, change of the state) -> (Hessian, gradient). At an earlier node: (Hessian and
    gradient of the next node, Jacobian of the next state, state and control, p, change, factor on the
    weights) -> (Hessian, gradient, the control's column of the Hessian, the control's gradient).
    """
    nx = ocp.n_state
    zu, p, change = ca.SX.sym("zu", nx + 1), ca.SX.sym("p", ocp.n_param), ca.SX.sym("change", nx)
    hess, grad, m = ca.SX.sym("hess", nx, nx), ca.SX.sym("grad", nx), ca.SX.sym("m", nx, nx + 1)
    factor = ca.SX.sym("factor")
    stage, terminal = ocp.residuals(zu[:-1], zu[-1], p)

    block, slope = _gauss_newton(terminal, zu, change, ca.SX(ocp.terminal_weights))
    end = ca.Function("end", [zu[:-1], p, change], [block[:nx, :nx], slope[:nx]])
    block, slope = _gauss_newton(stage, zu, change, factor * ca.SX(ocp.weights))
    block = ca.triu2symm(ca.triu(block + m.T @ (hess @ m)))
    slope += m.T @ grad
    outputs = [block[:nx, :nx], slope[:nx], block[:, nx], slope[nx]]
    return end, ca.Function("back", [hess, grad, m, zu, p, change, factor], outputs)


def _linearise(
    ocp: Ocp, integrators: dict[int, ca.Function], zu: list[ca.SX], p: ca.SX
) -> list[tuple[ca.SX, ca.SX]]:
    kinds = [n for n, _ in ocp.intervals]
    if not ocp.linear:
        return [integrators[n](zu_k, p) for n, zu_k in zip(kinds, zu, strict=True)]
    matrix = {n: integrate(zu[0], p)[1] for n, integrate in integrators.items()}
    return [(matrix[n] @ zu_k, matrix[n]) for n, zu_k in zip(kinds, zu, strict=True)]


def integrators_of(ocp: Ocp) -> dict[int, ca.Function]:
    step = rk4(ocp)
    return {n: _integrator(ocp, step, n) for n in dict.fromkeys(n for n, _ in ocp.intervals)}


def condense(ocp: Ocp, integrators: dict[int, ca.Function]) -> ca.Function:
    """(trajectory, first state, p) -> the quadratic program in the change of the controls.

    Returns its Hessian and gradient, the states of all nodes for unchanged controls, and their Jacobian with
    respect to all controls. Each column of the Hessian comes from that Jacobian at its node and the second
    derivatives of all later costs, which avoids products of large matrices.
    """
    n, nx = ocp.n_control, ocp.n_state
    old, z0, p = ca.SX.sym("old", ocp.n_trajectory), ca.SX.sym("z0", nx), ca.SX.sym("p", ocp.n_param)
    z = ca.vertsplit(old[: nx * (n + 1)], nx)
    zu = [ca.vertcat(z[k], old[nx * (n + 1) + k]) for k in range(n)]

    change, sensitivity = [z0 - z[0]], [ca.SX(nx, 0)]
    intervals = _linearise(ocp, integrators, zu, p)
    for k, (following, m) in enumerate(intervals):
        a, b = m[:, :nx], m[:, nx]
        change.append(following + a @ change[k] - z[k + 1])
        sensitivity.append(ca.horzcat(a @ sensitivity[k], b))

    end, back = _backward(ocp)
    columns, gradient = [], []
    hess, grad = end(z[n], p, change[n])
    for k in reversed(range(n)):
        factor = ocp.intervals[k][1]
        hess, grad, by_u, slope = back(hess, grad, intervals[k][1], zu[k], p, change[k], factor)
        columns.append(ca.vertcat(sensitivity[k].T @ by_u[:nx], by_u[nx], ca.SX(n - 1 - k, 1)))
        gradient.append(slope)

    states = ca.vertcat(*z) + ca.vertcat(*change)
    derivative = ca.vertcat(*(ca.horzcat(e, ca.SX(nx, n - k)) for k, e in enumerate(sensitivity)))
    outputs = [ca.triu2symm(ca.horzcat(*columns[::-1])), ca.vertcat(*gradient[::-1]), states, derivative]
    # Intermediate values do not share memory, because sharing costs a tenth of the time.
    return ca.Function("condense", [old, z0, p], outputs, {"live_variables": False})


def _shifted(ocp: Ocp, integrate: ca.Function, new: ca.MX, p: ca.MX) -> ca.MX:
    """The trajectory shifted by one interval; the last control is held through the last interval."""
    end = ocp.n_state * (ocp.n_control + 1)
    last = ca.vertcat(new[end - ocp.n_state : end], new[-1])
    return ca.vertcat(new[ocp.n_state : end], integrate(last, p)[0], new[end + 1 :], new[-1])


def _solve_program(
    ocp: Ocp, hessian: ca.MX, gradient: ca.MX, rows: ca.MX, bounds: tuple[ca.MX, ca.MX, ca.MX, ca.MX]
) -> tuple[ca.MX, ca.MX]:
    """The minimiser of the quadratic program and 1, or a fallback and 0 if none is found.

    The fallback changes bounded controls as if states had no bounds, and keeps unbounded ones.

    CasADi's plug-in does not report success inside a graph, so the optimality conditions are tested here. Its
    input checks are off, because they would raise on NaN; here, NaN is reported as not solved. If DAQP gives
    up, the plug-in leaves the results of an earlier call, which can be NaN.
    """
    low, high, x_low, x_high = bounds
    options = {"error_on_fail": False, "inputs_check": False}
    qp = ca.conic(ocp.name, "daqp", {"h": hessian.sparsity(), "a": rows.sparsity()}, options)
    sol = qp(h=hessian, g=gradient, a=rows, lba=low, uba=high, lbx=x_low, ubx=x_high)
    x = sol["x"]
    slopes = hessian @ x + gradient + rows.T @ sol["lam_a"] + sol["lam_x"]
    at = rows @ x
    excess = ca.mmax(ca.vertcat(low - at, at - high, x_low - x, x - x_high))
    stationary = ca.norm_inf(slopes) <= STATIONARITY_TOL * (1 + ca.norm_inf(gradient))
    stationary *= ca.norm_1(slopes) < math.inf  # `norm_inf` ignores NaN
    solved = stationary * (excess <= FEASIBILITY_TOL) * (ca.sumsqr(x) < LARGEST)
    unchanged = ca.MX.zeros(x.shape)
    if math.isinf(ocp.control_bound):
        return ca.if_else(solved, x, unchanged), solved
    descend = _descent(ocp.n_control).fold(SWEEPS)
    return ca.if_else(solved, x, descend(unchanged, hessian, gradient, x_low, x_high), True), solved


def _descent(n: int) -> ca.Function:
    """(x, Hessian, gradient, lowest, highest x) -> x after one sweep of projected coordinate descent.

    Each element goes to its best value within its bounds. Unlike active-set methods, this works at any
    condition of the Hessian.
    """
    x, h, g = ca.SX.sym("x", n), ca.SX.sym("h", n, n), ca.SX.sym("g", n)
    low, high = ca.SX.sym("low", n), ca.SX.sym("high", n)
    new = ca.vertsplit(x)
    for i in range(n):
        slope = g[i]
        for j in range(n):
            slope += h[i, j] * new[j]
        new[i] = ca.fmin(ca.fmax(new[i] - slope / h[i, i], low[i]), high[i])
    return ca.Function("descent", [x, h, g, low, high], [ca.vertcat(*new)])


def build_solver(ocp: Ocp) -> ca.Function:
    """Return one iteration: (trajectory, first state, p) -> (new trajectory, next guess, (solved, finite)).

    `solved` is 0 when the program has no solution (bounds that cannot be met) or is too badly conditioned for
    DAQP; then bounded controls are chosen as if states had no bounds, and unbounded ones are kept. `finite`
    is 0 for NaN or infinity in the input or the result; the trajectories are then meaningless. Equal inputs
    give equal bytes in any order of calls.
    """
    n, nx = ocp.n_control, ocp.n_state
    old, z0 = ca.MX.sym("old", ocp.n_trajectory), ca.MX.sym("z0", nx)
    p = ca.MX.sym("p", ocp.n_param)
    integrators = integrators_of(ocp)
    hessian, gradient, states, derivative = condense(ocp, integrators)(old, z0, p)

    bounded = [(nx * k + i, lo, hi) for k in range(1, n + 1) for i, lo, hi in ocp.state_bounds]
    index, low, high = (list(values) for values in zip(*bounded, strict=True))
    rows, now, u = derivative[index, :], states[index], old[nx * (n + 1) :]
    bounds = (low - now, high - now, -ocp.control_bound - u, ocp.control_bound - u)
    du, solved = _solve_program(ocp, hessian, gradient, rows, bounds)

    new = ca.vertcat(states + derivative @ du, u + du)
    following = _shifted(ocp, integrators[ocp.intervals[-1][0]], new, p) if ocp.shift else new
    finite = (ca.sumsqr(new) < LARGEST) * (ca.norm_1(gradient) < LARGEST_GRADIENT)
    return ca.Function(ocp.name, [old, z0, p], [new, following, ca.vertcat(solved, finite)])
