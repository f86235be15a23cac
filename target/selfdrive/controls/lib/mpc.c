/* One iteration of either model-predictive controller, with the operations of `build_solver` on the same doubles in
   the same order. mpc_generated.h has what CasADi derives from the problems; the rest follows mpc_solver.py,
   matrix by matrix. CasADi's DAQP solves the quadratic program; the address of its `daqp_quadprog` is an argument.

   Stands for: mpc_solver.py, horizon.py, lateral_ocp.py, long_ocp.py, mpc_generated.h, ../../common/ordered.py.
*/

#include <math.h>
#include <string.h>
#include "mpc_generated.h"

enum { N = 20, SHORT_INTERVALS = 5, STATES = 6, RESIDUALS = 5, ROWS = 2 * N, SWEEPS = 100 };

static const double FEASIBILITY_TOL = 1e-3, STATIONARITY_TOL = 1e-6, LARGEST = 1e100, LARGEST_GRADIENT = 1e300;

/* DAQPProblem and DAQPResult of DAQP's types.h and api.h; later versions can have more members. */
typedef struct {
    int n, m, ms;
    double *h, *f, *a, *upper, *lower;
    int *sense;
    void *more[16];
} Problem;

typedef struct {
    double *x, *lam, fval, soft_slack;
    int exitflag, iter, nodes;
    double solve_time, setup_time;
    void *more[16];
} Result;

typedef void Quadprog(Result *, Problem *, void *settings);

typedef struct {
    int nx, residuals, end_residuals, bounded, linear, shift;
    int state[2]; /* indices of bounded states */
    double low[2], high[2], control_bound;
    double sixth; /* of the RK4 step, s */
    void (*rk4)(const double *, const double *, const double *, double *, double *, double *, double *);
    void (*stage)(const double *, const double *, double *, double *, double *, double *);
    void (*end)(const double *, const double *, double *, double *, double *, double *);
} Model;

typedef struct {
    double h[N][N], gradient[N], states[N + 1][STATES], derivative[N + 1][STATES][N];
} Condensed;

typedef double Matrix[STATES][STATES + 1];

#define INLINE static inline __attribute__((always_inline))
#define UNROLL _Pragma("GCC unroll 8") /* so that the compiler can omit absent terms */

INLINE double larger(double a, double b) /* b can be NaN */
{
    return b > a ? b : a;
}

/* The rows of column `j` of a step's Jacobian (with respect to state and control) that are not always 0 start at
   `first` and end before `behind`. The others are left out, because 0 times infinity is NaN. The longitudinal
   problem's states 3 to 5 are the lead's and do not depend on the host's. */
INLINE int first(const Model model, int j)
{
    return model.linear && j >= 3 && j < 6 ? 3 : 0;
}

INLINE int behind(const Model model, int j)
{
    return j < model.nx ? j + 1 : model.linear ? 3 : model.nx;
}

INLINE int width(const Model model, int i) /* end of the state columns in row `i` */
{
    return model.linear && i < 3 ? 3 : model.nx;
}

/* RK4 steps: the next state, and its Jacobian with respect to state and control; `over` has the factors of `sixth` in
   the last step's Jacobian with respect to the state.

   CasADi multiplies constants first: c * (sixth * x) becomes (c * sixth) * x. */
INLINE void integrate(
    const Model model, int steps, const double *zu, const double *p, double *end, Matrix m, double *over)
{
    const int nx = model.nx;
    memcpy(end, zu, nx * sizeof *end);
    for (int i = 0; i < nx; i++)
        for (int j = 0; j <= nx; j++)
            m[i][j] = i == j;
    for (int step = 0; step < steps; step++) {
        double next[STATES], a[STATES * STATES] = {0}, b[STATES] = {0};
        Matrix was;
        memcpy(was, m, sizeof was);
        model.rk4(end, zu + nx, p, next, a, b, over);
        UNROLL
        for (int i = 0; i < nx; i++) {
            UNROLL
            for (int j = 0; j <= nx; j++) {
                double sum = 0.0;
                UNROLL
                for (int r = i; r < width(model, i); r++)
                    if (model.linear && step == 1 && i == 3 && r == 4 && j == 5)
                        sum += a[i * nx + r] * model.sixth * over[r * nx + j];
                    else if (!model.linear && i < 3 && r == 3 && j == 4)
                        sum += was[r][j] * model.sixth * over[i * nx + r];
                    else
                        sum += a[i * nx + r] * was[r][j];
                m[i][j] = sum;
            }
            m[i][nx] += b[i];
            end[i] = next[i];
        }
    }
}

/* Residuals of a node, and their Jacobian with respect to its state and control. For elements 0.1 * x of the
   Jacobian, `over` has x; for elements 1 / x and -1 / x, `under` has x and -x. */
typedef struct {
    double r[RESIDUALS], c[RESIDUALS * (STATES + 1)], over[RESIDUALS * (STATES + 1)], under[RESIDUALS * (STATES + 1)];
} Cost;

/* A number times an element of the Jacobian: CasADi calculates y / x for y * (1 / x). */
INLINE double by(const Model model, const Cost *cost, int k, int i, double y)
{
    const int place = k * (model.nx + 1) + i, quotient = model.linear && k == 1 && (i == 0 || i == 3);
    return quotient ? y / cost->under[place] : y * cost->c[place];
}

/* A weight times an element of the Jacobian: CasADi multiplies constants first. */
INLINE double weighed(const Model model, const Cost *cost, int k, int i, double weight)
{
    const int product = model.linear && k >= 2 && i == 1;
    return product ? weight * 0.1 * cost->over[k * (model.nx + 1) + i] : by(model, cost, k, i, weight);
}

/* Hessian (for a stage, its upper half) and gradient of a cost with respect to state and control; the gradient is the
   one after a change of the state. Only a stage's last residual depends on the control; the others are left out,
   because 0 * NaN is NaN. */
INLINE void gauss_newton(
    const Model model, int stage, const Cost *cost, const double *weights, const double *change,
    double hess[STATES + 1][STATES + 1], double *slope)
{
    const int nx = model.nx, count = stage ? model.residuals : model.end_residuals;
    double cw[STATES + 1][RESIDUALS], moved[RESIDUALS];
    UNROLL
    for (int k = 0; k < count; k++) {
        double sum = 0.0;
        UNROLL
        for (int j = 0; j < nx; j++)
            sum += by(model, cost, k, j, change[j]);
        moved[k] = cost->r[k] + sum;
        UNROLL
        for (int i = 0; i <= nx; i++)
            cw[i][k] = weighed(model, cost, k, i, weights[k]);
    }
    UNROLL
    for (int i = 0; i <= nx; i++) {
        UNROLL
        for (int j = stage ? i : 0; j <= nx; j++) {
            double sum = 0.0;
            UNROLL
            for (int k = i == nx || j == nx ? count - 1 : 0; k < count; k++)
                sum += by(model, cost, k, j, cw[i][k]);
            hess[i][j] = sum;
        }
        slope[i] = 0.0;
        UNROLL
        for (int k = i == nx ? count - 1 : 0; k < count; k++)
            slope[i] += cw[i][k] * moved[k];
    }
}

/* `condense`: the quadratic program in the change of the controls. */
INLINE void condense(
    const Model model, const double *weights, const double *old, const double *z0, const double *p, Condensed *to)
{
    const int nx = model.nx;
    const double *controls = old + nx * (N + 1);
    double zu[N + 1][STATES + 1], change[N + 1][STATES];
    double over[STATES * STATES];
    Matrix m[N], fixed[2];

    for (int k = 0; k <= N; k++) {
        memcpy(zu[k], old + nx * k, nx * sizeof(double));
        zu[k][nx] = k < N ? controls[k] : 0.0;
    }
    if (model.linear) {
        double unused[STATES];
        integrate(model, 1, zu[0], p, unused, fixed[0], over);
        integrate(model, 3, zu[0], p, unused, fixed[1], over);
    }
    for (int i = 0; i < nx; i++) {
        to->states[0][i] = z0[i];
        change[0][i] = z0[i] - zu[0][i];
    }
    for (int k = 0; k < N; k++) {
        double following[STATES];
        if (model.linear) {
            memcpy(m[k], fixed[k >= SHORT_INTERVALS], sizeof m[k]);
            for (int i = 0; i < nx; i++) {
                following[i] = 0.0;
                for (int j = 0; j <= nx; j++)
                    following[i] += m[k][i][j] * zu[k][j];
            }
        } else {
            integrate(model, k < SHORT_INTERVALS ? 1 : 3, zu[k], p, following, m[k], over);
        }
        for (int i = 0; i < nx; i++) {
            double sum = 0.0, by[N] = {0};
            for (int r = i; r < width(model, i); r++) {
                const int constant = !model.linear && k < SHORT_INTERVALS && i < 3 && r == 3; /* the derivative */
                sum += m[k][i][r] * change[k][r];
                for (int j = 0; j < k && i < behind(model, nx); j++)
                    by[j] += constant ? to->derivative[k][r][j] * model.sixth * over[i * nx + r]
                                      : m[k][i][r] * to->derivative[k][r][j];
            }
            to->states[k + 1][i] = following[i] + sum; /* CasADi calculates z + (x - z) for x */
            change[k + 1][i] = to->states[k + 1][i] - zu[k + 1][i];
            by[k] = m[k][i][nx];
            memcpy(to->derivative[k + 1][i], by, sizeof by);
        }
    }

    double hess[STATES + 1][STATES + 1], grad[STATES + 1];
    Cost cost = {0};
    model.end(zu[N], p, cost.r, cost.c, cost.over, cost.under);
    gauss_newton(model, 0, &cost, weights, change[N], hess, grad);
    for (int k = N - 1; k >= 0; k--) {
        double block[STATES + 1][STATES + 1], slope[STATES + 1], hm[STATES][STATES + 1], scaled[RESIDUALS];
        for (int i = 0; i < model.residuals; i++)
            scaled[i] = (k < SHORT_INTERVALS ? 1.0 : 3.0) * weights[i];
        memset(&cost, 0, sizeof cost);
        model.stage(zu[k], p, cost.r, cost.c, cost.over, cost.under);
        gauss_newton(model, 1, &cost, scaled, change[k], block, slope);
        UNROLL
        for (int i = 0; i < nx; i++)
            UNROLL
            for (int j = 0; j <= nx; j++) {
                hm[i][j] = 0.0;
                UNROLL
                for (int l = first(model, j); l < behind(model, j); l++)
                    hm[i][j] += hess[i][l] * m[k][l][j];
            }
        UNROLL
        for (int i = 0; i <= nx; i++) {
            double sum = 0.0;
            UNROLL
            for (int j = i; j <= nx; j++) {
                double product = 0.0;
                UNROLL
                for (int l = first(model, i); l < behind(model, i); l++)
                    product += m[k][l][i] * hm[l][j];
                block[i][j] += product;
            }
            UNROLL
            for (int l = first(model, i); l < behind(model, i); l++)
                sum += m[k][l][i] * grad[l];
            slope[i] += sum;
        }
        UNROLL
        for (int i = 0; i < nx; i++) {
            UNROLL
            for (int j = 0; j < nx; j++)
                hess[i][j] = i <= j ? block[i][j] : block[j][i];
            grad[i] = slope[i];
        }
        for (int j = 0; j < k; j++) {
            double sum = 0.0;
            for (int i = 0; i < behind(model, nx); i++)
                sum += to->derivative[k][i][j] * block[i][nx];
            to->h[j][k] = to->h[k][j] = sum;
        }
        to->h[k][k] = block[nx][nx];
        to->gradient[k] = slope[nx];
    }
}

/* `_solve_program`: the minimiser and 1, or the fallback and 0 if none is found. */
INLINE double solve(const Model model, Quadprog *quadprog, Condensed *of, const double *u, double *x)
{
    const int rows = N * model.bounded;
    double a[ROWS][N], lower[N + ROWS], upper[N + ROWS], lam[N + ROWS] = {0};
    int sense[N + ROWS];
    for (int j = 0; j < N; j++) {
        x[j] = 0.0;
        lower[j] = -model.control_bound - u[j];
        upper[j] = model.control_bound - u[j];
    }
    for (int row = 0; row < rows; row++) {
        const int k = 1 + row / model.bounded, which = row % model.bounded, i = model.state[which];
        memcpy(a[row], of->derivative[k][i], sizeof a[row]);
        memset(a[row] + k, 0, (N - k) * sizeof(double));
        lower[N + row] = model.low[which] - of->states[k][i];
        upper[N + row] = model.high[which] - of->states[k][i];
    }
    for (int j = 0; j < N + rows; j++)
        sense[j] = lower[j] == upper[j] ? 5 : 0; /* DAQP's ACTIVE and IMMUTABLE */
    Problem problem = {N, N + rows, N, of->h[0], of->gradient, a[0], upper, lower, sense, {0}};
    Result result = {.x = x, .lam = lam};
    quadprog(&result, &problem, NULL);

    double slope = 0.0, sum = 0.0, largest = 0.0, excess = -INFINITY, square = 0.0;
    for (int i = 0; i < N; i++) {
        double by_h = 0.0, by_rows = 0.0;
        for (int j = 0; j < N; j++)
            by_h += of->h[j][i] * x[j];
        for (int row = 0; row < rows; row++)
            by_rows += a[row][i] * lam[N + row];
        const double at = fabs(by_h + of->gradient[i] + by_rows + lam[i]);
        slope = larger(slope, at);
        sum += at;
        largest = larger(largest, fabs(of->gradient[i]));
        excess = larger(larger(excess, lower[i] - x[i]), x[i] - upper[i]);
        square += x[i] * x[i];
    }
    for (int row = 0; row < rows; row++) {
        double at = 0.0;
        for (int j = 0; j < N; j++)
            at += a[row][j] * x[j];
        excess = larger(larger(excess, lower[N + row] - at), at - upper[N + row]);
    }
    const int stationary = slope <= STATIONARITY_TOL * (1.0 + largest) && sum < INFINITY;
    const int solved = stationary && excess <= FEASIBILITY_TOL && square < LARGEST;
    if (!solved)
        memset(x, 0, N * sizeof *x);
    for (int sweep = 0; !solved && !isinf(model.control_bound) && sweep < SWEEPS; sweep++)
        for (int i = 0; i < N; i++) {
            slope = of->gradient[i];
            for (int j = 0; j < N; j++)
                slope += of->h[i][j] * x[j];
            x[i] = fmin(fmax(x[i] - slope / of->h[i][i], lower[i]), upper[i]);
        }
    return solved;
}

/* `build_solver`: `call` has the addresses of DAQP's function, weights, arguments and results. */
INLINE void iterate(const Model model, void **call)
{
    const int nx = model.nx, end = nx * (N + 1);
    const double *old = call[2], *p = call[4];
    double *new = call[5], *next = call[6], *flags = call[7], x[N], square = 0.0, sum = 0.0;
    Condensed of;
    condense(model, call[1], old, call[3], p, &of);
    flags[0] = solve(model, (Quadprog *)call[0], &of, old + end, x);
    for (int k = 0; k <= N; k++)
        for (int i = 0; i < nx; i++) {
            double moved = 0.0;
            for (int j = 0; j < k; j++)
                moved += of.derivative[k][i][j] * x[j];
            new[nx * k + i] = of.states[k][i] + moved;
        }
    for (int j = 0; j < N; j++)
        new[end + j] = old[end + j] + x[j];
    memcpy(next, new, (end + N) * sizeof *next);
    if (model.shift) {
        double last[STATES + 1], over[STATES * STATES];
        Matrix unused;
        memcpy(next, new + nx, (end - nx) * sizeof *next);
        memcpy(last, new + end - nx, nx * sizeof *last);
        last[nx] = new[end + N - 1];
        integrate(model, 3, last, p, next + end - nx, unused, over);
        memcpy(next + end, new + end + 1, (N - 1) * sizeof *next);
    }
    for (int j = 0; j < end + N; j++)
        square += new[j] * new[j];
    for (int j = 0; j < N; j++)
        sum += fabs(of.gradient[j]);
    flags[1] = square < LARGEST && sum < LARGEST_GRADIENT;
}

/* Whether DAQP is compatible: minimise x^2 + y^2 - 2 x - 6 y with y <= 2 and x + y <= 10. */
int agrees(Quadprog *quadprog)
{
    double h[4] = {2.0, 0.0, 0.0, 2.0}, f[2] = {-2.0, -6.0}, a[2] = {1.0, 1.0}, x[2] = {0}, lam[3] = {0};
    double lower[3] = {-5.0, -INFINITY, -10.0}, upper[3] = {5.0, 2.0, 10.0};
    int sense[3] = {0};
    Problem problem = {2, 3, 2, h, f, a, upper, lower, sense, {0}};
    Result result = {.x = x, .lam = lam};
    quadprog(&result, &problem, NULL);
    return fabs(x[0] - 1.0) + fabs(x[1] - 2.0) + fabs(lam[0]) + fabs(lam[1] - 2.0) + fabs(lam[2]) < 1e-9;
}

void long_iteration(void **call)
{
    const Model model = {
        .nx = 6, .residuals = 4, .end_residuals = 3, .linear = 1, .sixth = 0.2 / 6, .control_bound = INFINITY,
        .bounded = 1, .state = {1}, .low = {-0.0}, .high = {INFINITY},
        .rk4 = long_mpc_rk4, .stage = long_mpc_stage, .end = long_mpc_end,
    };
    iterate(model, call);
}

void lateral_iteration(void **call)
{
    const double heading = 1.5707963267948966, delta = 0.4363323129985824; /* 90 and 25 degrees */
    const Model model = {
        .nx = 4, .residuals = 5, .end_residuals = 4, .shift = 1, .sixth = 0.05 / 6, .control_bound = 0.1,
        .bounded = 2, .state = {2, 3}, .low = {-heading, -delta}, .high = {heading, delta},
        .rk4 = lateral_mpc_rk4, .stage = lateral_mpc_stage, .end = lateral_mpc_end,
    };
    iterate(model, call);
}
