/* Stands for: voting.py, band_filter.py, road_view.py, ../common/array_math.py, sums.h.
 * From points in the map of the road to lines, with the same bits as in Python: the same operations in the same
 * order and precision, sums in numpy's order, filters in OpenCV's. */

#include <math.h>
#include <stdint.h>
#include "sums.h"

enum { BINS = 80, OUTSIDE = 1, AROUND = 10, GAP = 3, LOG_TERMS = 10, MOST = 512 };
static const double BIN = 0.1, SIDEWAYS = 4.0, LEFT_STEP = 4.0, DIP_STEP = 6.0;
static const float SCATTER = 0.005f;
static const double BESIDE = 0.8;
static const float FAINT = 0.02f, ALIKE = 10.0f, BLUR[2] = {0.5f, 0.05f};

enum { UNKNOWN = 4, TERMS = UNKNOWN + 1, ROUNDS = 4 };
static const double NEAR[ROUNDS] = {0.30, 0.20, 0.15, 0.15};

/* Solve matrix * x = right by elimination; `rows` have both. */
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

/* `dot` of sums.h without memory for the products. */
INLINE double dot_of_few(const double *a, const double *b, long count)
{
    double s[8], sum = 0.0;
    long k = 0;
    if (count >= 8) {
        for (; k < 8; k++)
            s[k] = a[k] * b[k];
        for (; k < count - count % 8; k += 8)
            for (long lane = 0; lane < 8; lane++)
                s[lane] += a[k + lane] * b[k + lane];
        sum = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    }
    for (; k < count; k++)
        sum += a[k] * b[k];
    return sum;
}

typedef double Dot(const double *a, const double *b, long count);

static double dot_plain(const double *a, const double *b, long count)
{
    long half = count / 2 - count / 2 % 8;
    return count <= 128 ? dot_of_few(a, b, count) : dot_plain(a, b, half) + dot_plain(a + half, b + half, count - half);
}

#if defined(__x86_64__) && !defined(PLAIN)
__attribute__((target("avx2"))) static double dot_fast(const double *a, const double *b, long count)
{
    long half = count / 2 - count / 2 % 8;
    return count <= 128 ? dot_of_few(a, b, count) : dot_fast(a, b, half) + dot_fast(a + half, b + half, count - half);
}
#endif

INLINE void step(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
                 double near, const double *expected, const double *believed, const double *prior, double *state,
                 double *metre, double *error, double *count, double *room, Dot *scalar_product)
{
    double *terms[TERMS], *weighted[UNKNOWN], rows[UNKNOWN][TERMS], sums[TERMS][UNKNOWN], surprise[UNKNOWN];
    double by[UNKNOWN];
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
            count[k] = much <= 0.0 ? 0.0 : much; /* NaN is kept */
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
            sums[i][j] = scalar_product(terms[i], weighted[j], 2 * n);
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
                      double *metre, double *error, double *count, double *room, Dot *scalar_product)
{
    for (int k = 0; k < ROUNDS; k++)
        step(left, drop, voters_metre, precision, n, NEAR[k], expected, believed, prior, state, metre, error, count,
             room, scalar_product);
}

typedef void Settle(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
                    const double *expected, const double *believed, const double *prior, double *state,
                    double *metre, double *error, double *count, double *room);

static void settle_plain(const float *left, const float *drop, const float *voters_metre, const float *precision,
                         long n, const double *expected, const double *believed, const double *prior, double *state,
                         double *metre, double *error, double *count, double *room)
{
    all_steps(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count, room,
              dot_plain);
}

#if defined(__x86_64__) && !defined(PLAIN)
__attribute__((target("avx2"))) static void
settle_fast(const float *left, const float *drop, const float *voters_metre, const float *precision, long n,
            const double *expected, const double *believed, const double *prior, double *state, double *metre,
            double *error, double *count, double *room)
{
    all_steps(left, drop, voters_metre, precision, n, expected, believed, prior, state, metre, error, count, room,
              dot_fast);
}
#endif

/* Move `state` by all steps. `metre` (n), `error` and `count` (2, n) become those of the last step, before it moved.
 * `expected` (4, 4) times its own transpose is `prior`; `room` has space for 18 numbers per point. */
static Settle *settle(void)
{
#if defined(__x86_64__) && !defined(PLAIN)
    if (__builtin_cpu_supports("avx2"))
        return settle_fast;
#endif
    return settle_plain;
}

/* The expected value of one number, and its candidates; `count` is 0 if there would be too many. */
typedef struct {
    double mean, sigma;
    long count;
    float at[MOST];
} Expected;

static void expect(const double *belief, double step, Expected *of)
{
    of->mean = belief[0], of->sigma = belief[1], of->count = 0;
    if (!(fabs(of->mean) < 1e6 && of->sigma > 0.0 && of->sigma < 0.25 * step * MOST - step))
        return;
    long n = (long)(2.0 * of->sigma / step);
    for (long k = -n; k <= n; k++)
        of->at[of->count++] = (float)(of->mean + step * (double)k);
}

static float unlikely(const Expected *of, float value)
{
    float off = (value - (float)of->mean) / (float)of->sigma;
    return off * off;
}

/* `log` of array_math.py: 2 artanh((m - 1) / (m + 1)) of the mantissa m, plus the exponent times log 2. */
static double logarithm(float value)
{
    int power;
    float mantissa = frexpf(value, &power), series = 0.0f;
    if ((double)mantissa < sqrt(0.5)) {
        mantissa *= 2.0f;
        power--;
    }
    float ratio = (mantissa - 1.0f) / (mantissa + 1.0f), square = ratio * ratio;
    for (int k = LOG_TERMS; k >= 0; k--)
        series = series * square + (float)(2.0 / (2 * k + 1));
    return (double)(series * ratio) + power * (double)(float)0.6931471805599453;
}

/* Share of `rows` with a point, by bin of y, for lines that meet at (`left`, `dip`). */
static void take_votes(const float *lefts, const float *drops, const float *metres, const float *weights, long n,
                       float rows, float left, float dip, float *votes)
{
    double sums[BINS + 2 * OUTSIDE] = {0.0};
    for (long i = 0; i < n; i++) {
        float y = (lefts[i] - left) / (metres[i] * (drops[i] + dip));
        float bin = ((float)SIDEWAYS - y) * (float)(1.0 / BIN) + (float)OUTSIDE;
        long last = BINS + OUTSIDE; /* processors convert values out of range to the smallest integer */
        sums[bin >= (float)last ? (bin < 2147483648.0f ? last : 0) : bin > 0.0f ? (long)bin : 0] += weights[i];
    }
    float shares[BINS + 2] = {0.0f};
    for (int k = 0; k < BINS; k++)
        shares[k + 1] = (float)sums[k + OUTSIDE] / rows;
    for (int k = 0; k < BINS; k++)
        votes[k] = (0.5f * shares[k] + shares[k + 1]) + 0.5f * shares[k + 2];
}

/* How much the votes for each y exceed those around it. */
static void take_support(const float *votes, float unlikely, double *support)
{
    float wide[BINS + 2 * AROUND];
    for (int k = 0; k < BINS + 2 * AROUND; k++) {
        int from = k - AROUND;
        wide[k] = votes[from < 0 ? -1 - from : from < BINS ? from : 2 * BINS - 1 - from] * 0.0625f;
    }
    for (int k = 0; k < BINS; k++) {
        float around = 0.0f;
        for (int j = 0; j <= 2 * AROUND; j++)
            if (j < AROUND - GAP + 1 || j > AROUND + GAP - 1)
                around += wide[k + j];
        float over = votes[k] - around;
        support[k] = logarithm(1.0f + (over > 0.0f ? over : 0.0f) / (around + SCATTER)) - (double)unlikely;
    }
}

/* Choose the pair of lines: `pose` becomes left, dip, y_left, y_right. `belief` has means and deviations of left,
 * dip, middle and width; `room` has space for the supports of MOST candidates. Returns 0 if there are more
 * candidates, or if a lane does not fit. */
static long elect(const float *lefts, const float *drops, const float *metres, const float *weights, long n, double rows,
                  const double *belief, double *room, double *pose)
{
    Expected left, dip, middle, width;
    expect(belief, LEFT_STEP, &left);
    expect(belief + 2, DIP_STEP, &dip);
    expect(belief + 4, BIN, &middle);
    expect(belief + 6, BIN, &width);
    long all = left.count * dip.count;
    if (!all || all > MOST || !middle.count || !width.count)
        return 0;
    for (long k = 0; k < all; k++) {
        float votes[BINS], x = left.at[k / dip.count], down = dip.at[k % dip.count];
        take_votes(lefts, drops, metres, weights, n, (float)rows, x, down, votes);
        take_support(votes, 0.25f * (unlikely(&left, x) + unlikely(&dip, down)), room + k * BINS);
    }
    double y[BINS], best = -INFINITY;
    for (int k = 0; k < BINS; k++)
        y[k] = SIDEWAYS - BIN * (k + 0.5);
    for (long w = 0; w < width.count; w++) {
        double lane = rint((double)width.at[w] / BIN);
        if (!(lane >= 1.0 && lane < BINS))
            return 0;
        long apart = (long)lane, columns = BINS - apart;
        float prior[BINS];
        for (long k = 0; k < columns; k++) {
            double off = (0.5 * (y[k] + y[k + apart]) - middle.mean) / middle.sigma;
            prior[k] = 0.5f * ((float)(off * off) + unlikely(&width, width.at[w]));
        }
        for (long k = 0; k < all; k++)
            for (long column = 0; column < columns; column++) {
                const double *support = room + k * BINS + column;
                double pair = (support[0] + support[apart]) - (double)prior[column];
                if (pair > best) {
                    best = pair;
                    pose[0] = left.at[k / dip.count];
                    pose[1] = dip.at[k % dip.count];
                    pose[2] = y[column];
                    pose[3] = y[column + apart];
                }
            }
    }
    return best > -INFINITY;
}

/* The map of the road: `y` of its columns; `drop`, `scale` and `share` of its rows; `edge` columns at each side
 * without points. The rest is memory: for the points as voters, for the fit (18 and 5 numbers per point), for
 * supports. */
typedef struct {
    const float *y, *drop, *scale, *share;
    int64_t rows, columns, edge;
    float *left, *below, *metre, *weight, *precision;
    double *room, *found, *supports;
} Map;

/* Number of picture rows represented by the map's rows that are not uniform. */
static double rows_with_content(const Map *map, const uint8_t *road)
{
    float rows = 0.0f; /* shares are powers of two, so the order of the sum does not matter */
    for (long row = 0; row < map->rows; row++, road += map->columns) {
        long column = 1;
        while (column < map->columns && road[column] == road[0])
            column++;
        if (column < map->columns)
            rows += map->share[row];
    }
    return rows > 1.0f ? (double)rows : 1.0;
}

static void take_voters(const Map *map, const int64_t *at, const float *sure, long n)
{
    int64_t columns = map->columns - 2 * map->edge;
    for (long i = 0; i < n; i++) {
        long row = at[i] / columns, column = at[i] % columns + map->edge;
        float scale = map->scale[row], blur = BLUR[0] + BLUR[1] * scale;
        map->left[i] = map->y[column] * scale;
        map->below[i] = map->drop[row];
        map->metre[i] = scale / map->drop[row];
        map->weight[i] = sure[i] * map->share[row];
        map->precision[i] = map->weight[i] / (ALIKE * (blur * blur));
    }
}

/* `sum_of` of sums.h in single precision. */
static float sum_of_floats(const float *values, long count)
{
    if (count > 128) {
        long half = count / 2 - count / 2 % 8;
        return sum_of_floats(values, half) + sum_of_floats(values + half, count - half);
    }
    float s[8], sum = 0.0f;
    long k = 0;
    if (count >= 8) {
        memcpy(s, values, sizeof s);
        for (k = 8; k < count - count % 8; k += 8)
            for (long lane = 0; lane < 8; lane++)
                s[lane] += values[k + lane];
        sum = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    }
    for (; k < count; k++)
        sum += values[k];
    return sum;
}

/* Logarithm of a line's improbability, which rises with fewer points on the line and more points beside it. */
static double doubt(const Map *map, const double *metre, const double *error, const double *count, long n, double rows)
{
    const double near = NEAR[ROUNDS - 1];
    float *beside = map->precision; /* no longer needed */
    double *seen = map->room;
    for (long i = 0; i < n; i++) {
        double off = fabs(error[i] / metre[i]);
        beside[i] = (off > near && off < BESIDE ? 1.0f : 0.0f) * map->weight[i];
        seen[i] = count[i] * (double)map->weight[i];
    }
    float share = sum_of_floats(beside, n) / (float)rows;
    float chance = share * (float)(4.0 / 3.0 * near / (2.0 * (BESIDE - near)));
    double above = sum_of(seen, n) / rows - (double)chance;
    return -(above <= 0.0 ? 0.0 : above) / (double)(FAINT + chance);
}

/* Find the lines in the map `road`, which has `n` points with the positions `at` and certainties `sure`. `pose` becomes
 * left, dip, y_left, y_right, and the logarithms of the lines' improbabilities. Returns 0 if `elect` does. */
long vote(const Map *map, const uint8_t *road, const int64_t *at, const float *sure, long n, const double *belief,
          double *pose)
{
    static const double MIXED[UNKNOWN][UNKNOWN] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 0.5, 0.5}, {0, 0, 1, -1}};
    double expected[UNKNOWN * UNKNOWN], believed[UNKNOWN], prior[UNKNOWN * UNKNOWN];
    double *metre = map->found, *error = metre + n, *count = error + 2 * n;
    double rows = rows_with_content(map, road);
    take_voters(map, at, sure, n);
    if (!elect(map->left, map->below, map->metre, map->weight, n, rows, belief, map->supports, pose))
        return 0;
    for (int i = 0; i < UNKNOWN; i++) {
        double sigma = belief[2 * i + 1];
        believed[i] = belief[2 * i] / sigma;
        for (int j = 0; j < UNKNOWN; j++)
            expected[UNKNOWN * i + j] = MIXED[i][j] / sigma;
    }
    for (int i = 0; i < UNKNOWN; i++)
        for (int j = 0; j < UNKNOWN; j++) {
            double sum = 0.0;
            for (int k = 0; k < UNKNOWN; k++)
                sum += expected[UNKNOWN * k + i] * expected[UNKNOWN * k + j];
            prior[UNKNOWN * i + j] = sum;
        }
    settle()(map->left, map->below, map->metre, map->precision, n, expected, believed, prior, pose, metre, error,
             count, map->room);
    for (int side = 0; side < 2; side++)
        pose[4 + side] = doubt(map, metre, error + side * n, count + side * n, n, rows);
    return 1;
}
