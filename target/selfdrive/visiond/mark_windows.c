/* Stands for: hog.py, lane_net.py.
 * Finds windows of a picture with a lane mark. The features are the same as in Python to the bit, as integer
 * steps: the same operations in the same order, a cell's votes added in double precision, pixel by pixel. The
 * net's score is not, but its sign is: a coarse score decides if it is further from the threshold than its largest
 * error, else a score with exact sums; if even that is too close, Python decides. */

#include <math.h>
#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

enum { CELL = 4, BINS = 9, STRIDE = 16, WINDOW = 32, BLOCK = 4 * BINS, ACROSS = 7, ROW = ACROSS * BLOCK };
enum { FEATURES = ACROSS * ROW, PADDED = 1776, HIDDEN = 10, LANES = 16 };
enum { STEPS = 4096 };                 /* per unit of a feature */
static const double WHOLE = 1048576.0; /* per unit of a weight */
static const float TINY = 1e-10f;
static const double CLOSE = 1e-9; /* much larger than the rounding error of a sum of ten products */
static const float TANH_ERROR = 2e-4f;

/* Data for all pictures of one size. `coarse` has the weights by node, rounded to 1 / `coarse_steps`; `out_size` is
 * the sum of the absolute values of `out`. */
typedef struct {
    int64_t rows, width;
    double threshold;
    const double *lengths; /* of gradients by their squares, divided by the pixels of a cell */
    const int16_t *coarse;
    const double *whole;
    const float *bias, *out;
    float out_bias, out_size, coarse_steps;
    int32_t *squares, *bins; /* of the gradients in a row */
    double *sums;            /* of the cells in a row */
    float *cells;    /* rows / 4, width / 4, 9 */
    float *power;    /* of each cell */
    int16_t *blocks; /* rows / 4 - 1, width / 4 - 1, 36 */
} Net;

/* The square of a gradient's length and its bin, of nine, which are separated by the directions of 20, 40, 60 and 80
 * degrees and their mirror images. */
INLINE void gradient(int32_t dx, int32_t dy, int32_t *square, int32_t *bin)
{
    float across = (float)(dx < 0 ? -dx : dx), down = (float)(dy < 0 ? -dy : dy);
    int32_t of_quarter = (down > across * 0.36397023f) + (down > across * 0.83909963f) +
                         (down > across * 1.7320508f) + (down > across * 5.6712818f);
    int32_t mirrored = ((dx ^ dy) < 0) & (dy != 0);
    *bin = mirrored ? BINS - 1 - of_quarter : of_quarter;
    *square = dx * dx + dy * dy;
}

/* The gradients of columns `from` to `to` - 1 of a row. The picture is mirrored at its border. */
INLINE void gradients(const uint8_t *above, const uint8_t *row, const uint8_t *below, long width, long from, long to,
                      int32_t *restrict square, int32_t *restrict bin)
{
    long inner = from > 0 ? from : 1, end = to < width ? to : width - 1;
    for (long x = inner; x < end; x++)
        gradient(row[x + 1] - row[x - 1], below[x] - above[x], square + x - from, bin + x - from);
    if (from == 0)
        gradient(0, below[0] - above[0], square, bin);
    if (to == width)
        gradient(0, below[width - 1] - above[width - 1], square + width - 1 - from, bin + width - 1 - from);
}

/* Votes of the cells of a row of tiles, from tile `first` to `end` - 1. */
INLINE void votes(const Net *net, const uint8_t *picture, long tile_row, long first, long end)
{
    long width = net->width, from = first * STRIDE, to = end * STRIDE, count = (to - from) / CELL;
    double *restrict sums = net->sums;
    const double *restrict lengths = net->lengths;
    int32_t *restrict squares = net->squares, *restrict bins = net->bins;
    for (long top = tile_row * STRIDE; top < (tile_row + 1) * STRIDE; top += CELL) {
        memset(sums, 0, count * BINS * sizeof *sums);
        for (long y = top; y < top + CELL; y++) {
            const uint8_t *row = picture + y * width;
            int inner = y > 0 && y < net->rows - 1;
            gradients(inner ? row - width : row, row, inner ? row + width : row, width, from, to, squares, bins);
            /* Within a cell from left to right, but cell by cell, so that no sum waits for the previous one. */
            for (long k = 0; k < CELL; k++)
                for (long cell = 0; cell < count; cell++)
                    sums[cell * BINS + bins[cell * CELL + k]] += lengths[squares[cell * CELL + k]];
        }
        long at = top / CELL * (width / CELL) + from / CELL;
        for (long cell = 0; cell < count; cell++) {
            float *votes = net->cells + (at + cell) * BINS, s[BINS];
            for (long k = 0; k < BINS; k++) {
                votes[k] = (float)sums[cell * BINS + k];
                s[k] = votes[k] * votes[k];
            }
            net->power[at + cell] = (((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]))) + s[8];
        }
    }
}

/* Blocks of a row, from the column `first` to `end` - 1, in steps. */
INLINE void blocks(const Net *net, long y, long first, long end)
{
    long right = net->width / CELL;
    int16_t *out = net->blocks + (y * (right - 1) + first) * BLOCK;
    for (long x = first; x < end; x++, out += BLOCK) {
        const float *power = net->power + y * right + x;
        float sum = (power[0] + power[right]) + (power[1] + power[right + 1]);
        float scale = 1.0f / sqrtf(sum + TINY);
        for (long lower = 0; lower < 2; lower++) {
            const float *pair = net->cells + ((y + lower) * right + x) * BINS;
            for (long k = 0; k < 2 * BINS; k++) {
                /* Rounded to nearest, halves to even: beyond 2^23 a float has no fraction. */
                union { float number; int32_t bits; } whole = {(pair[k] * scale) * (float)STEPS + 12582912.0f};
                out[lower * 2 * BINS + k] = (int16_t)(whole.bits - 0x4b400000);
            }
        }
    }
}

/* tanh with an error below TANH_ERROR: Lambert's continued fraction, up to where it is close to 1. */
INLINE float about_tanh(float x)
{
    x = x > 4.9f ? 4.9f : x < -4.9f ? -4.9f : x;
    float square = x * x;
    float upper = x * (135135.0f + square * (17325.0f + square * (378.0f + square)));
    return upper / (135135.0f + square * (62370.0f + square * (3150.0f + square * 28.0f)));
}

/* The score of a window's steps and its largest error. */
INLINE float coarse_score(const Net *net, const int16_t *steps, float *error)
{
    float sums[LANES] = {0}, score = net->out_bias;
    int32_t all = 0;
    for (long k = 0; k < PADDED; k++)
        all += steps[k];
    for (long node = 0; node < HIDDEN; node++) {
        const int16_t *weights = net->coarse + node * PADDED;
        int32_t sum = 0;
        for (long k = 0; k < PADDED; k++)
            sum += (int32_t)steps[k] * weights[k];
        sums[node] = (float)sum;
    }
    for (long node = 0; node < HIDDEN; node++)
        sums[node] = about_tanh(sums[node] / (STEPS * net->coarse_steps) + net->bias[node]);
    for (long node = 0; node < HIDDEN; node++)
        score += sums[node] * net->out[node];
    /* Each weight is off by at most half a step, and tanh never enlarges an error. */
    *error = net->out_size * ((float)all / STEPS * (0.5f / net->coarse_steps) + TANH_ERROR);
    return score;
}

/* The score with Python's sums, which are exact in double precision. */
INLINE double exact_score(const Net *net, const int16_t *steps)
{
    double sums[HIDDEN] = {0}, score = 0.0;
    for (long k = 0; k < FEATURES; k++)
        for (long node = 0; node < HIDDEN; node++)
            sums[node] += (double)steps[k] * net->whole[k * HIDDEN + node];
    for (long node = 0; node < HIDDEN; node++)
        score += tanh(sums[node] / (STEPS * WHOLE) + (double)net->bias[node]) * (double)net->out[node];
    return score + (double)net->out_bias;
}

/* Whether any of the (up to four) windows that contain a tile is examined. */
INLINE int needed(const uint8_t *windows, long down, long across, long y, long x)
{
    for (long row = y > 0 ? y - 1 : 0; row <= y && row < down; row++)
        for (long column = x > 0 ? x - 1 : 0; column <= x && column < across; column++)
            if (windows[row * across + column])
                return 1;
    return 0;
}

/* The end of the run of needed tiles from column x on; x if that tile is not needed. */
INLINE long run_end(const uint8_t *windows, long down, long across, long y, long x)
{
    while (x <= across && needed(windows, down, across, y, x))
        x++;
    return x;
}

INLINE long marked(const Net *net, const uint8_t *picture, uint8_t *windows)
{
    long down = net->rows / STRIDE - 1, across = net->width / STRIDE - 1, in_row = net->width / CELL - 1;
    long ends = net->rows / CELL - 1, tile = STRIDE / CELL;
    int16_t steps[PADDED];
    for (long y = 0; y <= down; y++)
        for (long x = 0, end; x <= across; x = end + 1) {
            end = run_end(windows, down, across, y, x);
            if (end > x)
                votes(net, picture, y, x, end);
        }
    /* A block at the end of a run can use invalid values beyond it, because no window has that block. */
    for (long y = 0; y <= down; y++)
        for (long x = 0, end; x <= across; x = end + 1) {
            end = run_end(windows, down, across, y, x);
            for (long row = y * tile; row < (y + 1) * tile && row < ends; row++)
                blocks(net, row, x * tile, end * tile < in_row ? end * tile : in_row);
        }
    memset(steps, 0, sizeof steps);
    for (long y = 0; y < down; y++)
        for (long x = 0; x < across; x++) {
            if (!windows[y * across + x])
                continue;
            for (long row = 0; row < ACROSS; row++)
                memcpy(steps + row * ROW, net->blocks + ((y * tile + row) * in_row + x * tile) * BLOCK,
                       ROW * sizeof *steps);
            float error, score = coarse_score(net, steps, &error) - (float)net->threshold;
            if (fabsf(score) <= error) {
                double exact = exact_score(net, steps) - net->threshold;
                if (fabs(exact) <= CLOSE)
                    return 0;
                score = exact > 0.0 ? 1.0f : -1.0f;
            }
            windows[y * across + x] = score > 0.0f;
        }
    return 1;
}

static long plain(const Net *net, const uint8_t *picture, uint8_t *windows)
{
    return marked(net, picture, windows);
}

#if defined(__x86_64__) && !defined(PLAIN)
__attribute__((target("avx2"))) static long fast(const Net *net, const uint8_t *picture, uint8_t *windows)
{
    return marked(net, picture, windows);
}
#endif

/* Clear the windows (1: examine) that have no mark. Returns 0 if Python must decide. */
long which(const Net *net, const uint8_t *picture, uint8_t *windows)
{
#if defined(__x86_64__) && !defined(PLAIN)
    if (__builtin_cpu_supports("avx2"))
        return fast(net, picture, windows);
#endif
    return plain(net, picture, windows);
}
