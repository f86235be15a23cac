/* Stands for: voting.py, ../common/array_math.py, sums.h.
 * The steps of the fit, with the bits of the Python: the same operations in the same order, sums in numpy's. */

#include <math.h>
#include <stdint.h>
#include "sums.h"

enum { UNKNOWN = 4, TERMS = UNKNOWN + 1, ROUNDS = 4 };
static const double NEAR[ROUNDS] = {0.30, 0.20, 0.15, 0.15};

/* x of matrix * x = right, by elimination; `rows` have both. */
static void solve(double rows[UNKNOWN][TERMS], double *x)
{
    for (int i = 0; i < UNKNOWN; i++)
        for (int k = 0; k < UNKNOWN; k++) {
            if (k == i)
                continue;
            double factor = rows[k][i] / rows[i][i];
            for (int column = 0; column < TERMS; column++)
                rows[k][column] = rows[k][column] - factor * rows[i][column];
        }
    for (int i = 0; i < UNKNOWN; i++)
        x[i] = rows[i][UNKNOWN] / rows[i][i];
}

INLINE void step(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
                 double near, const double *expected, const double *believed, const double *prior, double *state,
                 double *metre, double *error, double *count, double *room)
{
    double *terms[TERMS], *weighted[UNKNOWN], rows[UNKNOWN][TERMS], sums[TERMS][UNKNOWN], surprise[UNKNOWN];
    double by[UNKNOWN], *products = room + 2 * n * (TERMS + UNKNOWN);
    for (int k = 0; k < TERMS; k++)
        terms[k] = room + 2 * n * k;
    for (int k = 0; k < UNKNOWN; k++)
        weighted[k] = room + 2 * n * (TERMS + k);
    for (long i = 0; i < n; i++)
        metre[i] = (double)voters_metre[i] * ((double)drop[i] + state[1]);
    for (int side = 0; side < 2; side++)
        for (long i = 0; i < n; i++) {
            long k = side * n + i;
            double y = state[2 + side];
            error[k] = ((double)left[i] - state[0]) - y * metre[i];
            double off = error[k] / (metre[i] * near), much = 1.0 - off * off;
            count[k] = much > 0.0 ? much : 0.0;
            terms[0][k] = 1.0;
            terms[1][k] = y * (double)voters_metre[i];
            terms[2][k] = side ? 0.0 : metre[i];
            terms[3][k] = side ? metre[i] : 0.0;
            terms[4][k] = error[k];
            double weight = count[k] * (double)precision[i];
            for (int j = 0; j < UNKNOWN; j++)
                weighted[j][k] = terms[j][k] * weight;
        }
    for (int i = 0; i < TERMS; i++)
        for (int j = 0; j < UNKNOWN; j++)
            sums[i][j] = dot(terms[i], weighted[j], 2 * n, products);
    for (int i = 0; i < UNKNOWN; i++) {
        const double *row = expected + UNKNOWN * i;
        surprise[i] = believed[i] - (((row[0] * state[0] + row[1] * state[1]) + row[2] * state[2]) + row[3] * state[3]);
    }
    for (int i = 0; i < UNKNOWN; i++) {
        double pull = expected[i] * surprise[0];
        for (int k = 1; k < UNKNOWN; k++)
            pull += expected[UNKNOWN * k + i] * surprise[k];
        for (int j = 0; j < UNKNOWN; j++)
            rows[i][j] = sums[i][j] + prior[UNKNOWN * i + j];
        rows[i][UNKNOWN] = sums[UNKNOWN][i] + pull;
    }
    solve(rows, by);
    for (int i = 0; i < UNKNOWN; i++)
        state[i] += by[i];
}

INLINE void all_steps(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
                      const double *expected, const double *believed, const double *prior, double *state,
                      double *metre, double *error, double *count, double *room)
{
    for (int k = 0; k < ROUNDS; k++)
        step(left, drop, voters_metre, precision, n, NEAR[k], expected, believed, prior, state, metre, error, count,
             room);
}

static void settle_plain(const float *left, const float *drop, const float *voters_metre, const float *precision,
                         long n, const double *expected, const double *believed, const double *prior, double *state,
                         double *metre, double *error, double *count, double *room)
{
    all_steps(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count, room);
}

#if defined(__x86_64__) && !defined(PLAIN)
__attribute__((target("avx2"))) static void
settle_fast(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
            const double *expected, const double *believed, const double *prior, double *state, double *metre,
            double *error, double *count, double *room)
{
    all_steps(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count, room);
}
#endif

/* Move `state` by all steps. `metre` (n), `error` and `count` (2, n) become those of the last one, before it moved.
 * `expected` (4, 4) times its own transpose is `prior`; `room` has space for 20 numbers for each point. */
void settle(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
            const double *expected, const double *believed, const double *prior, double *state, double *metre,
            double *error, double *count, double *room)
{
#if defined(__x86_64__) && !defined(PLAIN)
    if (__builtin_cpu_supports("avx2")) {
        settle_fast(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count,
                    room);
        return;
    }
#endif
    settle_plain(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count, room);
}
