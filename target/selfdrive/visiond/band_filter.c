/* Stands for: band_filter.py.
 * The operations have the same precision as in numpy and OpenCV and, where they round, the same order, so that the
 * bits are the same. */

#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

enum { NEAR = 5, EDGE = 8, REACH = 2 };       /* columns beside a single and a double line; a crest's neighbours */
enum { AHEAD = 2, ASIDE = 4 };          /* half a speck's rows; half the columns of the widest mean */
enum { WIDEST = 512 };                  /* most columns of a road map */
enum { ACROSS = 51, ALONG = 9, AT_ONCE = 8 }; /* columns and rows of the texture; rows summed at once */
static const float DARK = 12.0f, LEAST = 0.006f, QUIET = 1.6f;

typedef struct {
    const uint8_t *road; /* rows x width; those below, up to `sums`, are rows x inner columns */
    int64_t rows, width;
    uint8_t *eroded, *opened; /* as large as the road */
    float *contrast, *rough;
    double *sums;
    double *column, *padded; /* inner columns; AT_ONCE x (inner columns + ACROSS) */
    float *sure;             /* inner columns */
    int64_t *at;
    float *weight;
    float steepness;
} Bands;

/* OpenCV's substitute for a position outside a row: mirrored at the last pixel. */
INLINE long mirrored(long place, long size)
{
    return place < 0 ? -place : place < size ? place : 2 * size - 2 - place;
}

/* The lowest or highest level of the rows around each pixel's. */
INLINE void extreme(const uint8_t *restrict from, long rows, long width, int highest, uint8_t *restrict to)
{
    for (long y = 0; y < rows; y++) {
        long first = y > AHEAD ? y - AHEAD : 0, last = y + AHEAD < rows ? y + AHEAD : rows - 1;
        uint8_t *restrict out = to + y * width;
        for (long x = 0; x < width; x++)
            out[x] = from[first * width + x];
        for (long k = first + 1; k <= last; k++) {
            const uint8_t *row = from + k * width;
            for (long x = 0; x < width; x++)
                out[x] = highest ? (out[x] > row[x] ? out[x] : row[x]) : (out[x] < row[x] ? out[x] : row[x]);
        }
    }
}

/* Means of three rows and of the columns used for comparison, or of a single or double line's width. */
INLINE void means(const uint8_t *opened, long y, long rows, long width, float *restrict side, float *restrict one,
                  float *restrict two)
{
    uint16_t three[WIDEST + 2 * ASIDE];
    const uint8_t *before = opened + mirrored(y - 1, rows) * width, *here = opened + y * width;
    const uint8_t *after = opened + mirrored(y + 1, rows) * width;
    for (long x = 0; x < width; x++)
        three[ASIDE + x] = (uint16_t)(before[x] + here[x] + after[x]);
    for (long k = 1; k <= ASIDE; k++) {
        three[ASIDE - k] = three[ASIDE + k];
        three[ASIDE + width - 1 + k] = three[ASIDE + width - 1 - k];
    }
    for (long x = 0; x < width; x++) {
        const uint16_t *at = three + x;
        int of_three = at[3] + at[4] + at[5], of_five = of_three + at[2] + at[6];
        int of_nine = of_five + at[0] + at[1] + at[7] + at[8];
        side[x] = (float)of_five * (float)(1.0 / 15.0);
        one[x] = (float)of_three * (float)(1.0 / 9.0);
        two[x] = (float)of_nine * (float)(1.0 / 27.0);
    }
}

/* Contrast of bands and roughness of the inner points. */
INLINE void bands(const Bands *b)
{
    long inner = b->width - 2 * EDGE;
    float side[WIDEST], one[WIDEST], two[WIDEST];
    for (long y = 0; y < b->rows; y++) {
        means(b->opened, y, b->rows, b->width, side, one, two);
        const float *road = side + EDGE, *single = one + EDGE, *pair = two + EDGE;
        float *restrict of_row = b->contrast + y * inner, *restrict rough_row = b->rough + y * inner;
        for (long x = 0; x < inner; x++) {
            float left = road[x - NEAR], right = road[x + NEAR];
            float by_one = single[x] - (left > right ? left : right);
            float outer_left = road[x - EDGE], outer_right = road[x + EDGE];
            float by_two = pair[x] - (outer_left > outer_right ? outer_left : outer_right);
            float ground = (left + right) * 0.5f, light = ground + DARK;
            of_row[x] = (by_one > by_two ? by_one : by_two) / light;
            rough_row[x] = fabsf(single[x] - ground) / light;
        }
    }
}

/* Running sums of roughness along rows, several rows at once, because each sum waits for the previous one. */
INLINE void sums_of_rows(const Bands *b)
{
    long inner = b->width - 2 * EDGE, wide = inner + ACROSS - 1;
    for (long first = 0; first < b->rows; first += AT_ONCE) {
        long count = b->rows - first < AT_ONCE ? b->rows - first : AT_ONCE;
        for (long k = 0; k < count; k++) {
            const float *row = b->rough + (first + k) * inner;
            double *restrict padded = b->padded + k * wide;
            for (long x = 0; x < ACROSS / 2; x++) {
                padded[x] = row[ACROSS / 2 - x];
                padded[ACROSS / 2 + inner + x] = row[inner - 2 - x];
            }
            for (long x = 0; x < inner; x++)
                padded[ACROSS / 2 + x] = row[x];
        }
        double sum[AT_ONCE] = {0.0};
        const double *padded = b->padded;
        double *sums = b->sums + first * inner;
        for (long x = 0; x < ACROSS; x++)
            for (long k = 0; k < AT_ONCE; k++)
                sum[k] += padded[k * wide + x];
        for (long k = 0; k < AT_ONCE; k++)
            sums[k * inner] = sum[k];
        for (long x = 0; x < inner - 1; x++)
            for (long k = 0; k < AT_ONCE; k++) {
                sum[k] += padded[k * wide + x + ACROSS] - padded[k * wide + x];
                sums[k * inner + x + 1] = sum[k];
            }
    }
}

/* Whether contrast is the highest of the surrounding columns. */
INLINE int is_crest(const float *row, const float *sure, long x, long inner)
{
    int highest = sure[x] > 0.0f;
    for (long k = x > REACH ? x - REACH : 0; k <= x + REACH && k < inner; k++)
        highest &= row[x] >= row[k];
    return highest;
}

/* Positions and weights of the crests. */
INLINE long crests_of(const Bands *b)
{
    long found = 0, inner = b->width - 2 * EDGE;
    double *restrict column = b->column;
    float *restrict sure = b->sure;
    for (long x = 0; x < inner; x++)
        column[x] = 0.0;
    for (long y = -ALONG / 2; y < ALONG / 2; y++) {
        const double *sums = b->sums + mirrored(y, b->rows) * inner;
        for (long x = 0; x < inner; x++)
            column[x] += sums[x];
    }
    for (long y = 0; y < b->rows; y++) {
        const float *row = b->contrast + y * inner;
        const double *enters = b->sums + mirrored(y + ALONG / 2, b->rows) * inner;
        const double *leaves = b->sums + mirrored(y - ALONG / 2, b->rows) * inner;
        for (long x = 0; x < inner; x++) {
            double sum = column[x] + enters[x];
            float texture = (float)(sum * (1.0 / (ACROSS * ALONG)));
            column[x] = sum - leaves[x];
            sure[x] = (row[x] / (texture + LEAST) - QUIET) * b->steepness;
        }
        int32_t crest[WIDEST + 1]; /* in pairs, because most are not crests */
        for (long x = REACH; x < inner - REACH; x++)
            crest[x] = (sure[x] > 0.0f) & (row[x] >= row[x - 2]) & (row[x] >= row[x - 1]) & (row[x] >= row[x + 1]) &
                       (row[x] >= row[x + 2]);
        for (long k = 0; k < REACH; k++) {
            crest[k] = is_crest(row, sure, k, inner);
            crest[inner - 1 - k] = is_crest(row, sure, inner - 1 - k, inner);
        }
        crest[inner] = 0;
        for (long x = 0; x < inner; x += 2) {
            if (!(crest[x] | crest[x + 1]))
                continue;
            for (long k = x; k < x + 2; k++)
                if (crest[k]) {
                    b->at[found] = y * inner + k;
                    b->weight[found++] = sure[k] < 1.0f ? sure[k] : 1.0f;
                }
        }
    }
    return found;
}

INLINE long all_crests(const Bands *b)
{
    extreme(b->road, b->rows, b->width, 0, b->eroded);
    extreme(b->eroded, b->rows, b->width, 1, b->opened);
    bands(b);
    sums_of_rows(b);
    return crests_of(b);
}

static long crests_plain(const Bands *b)
{
    return all_crests(b);
}

#if defined(__x86_64__) && !defined(PLAIN)
__attribute__((target("avx2"))) static long crests_fast(const Bands *b)
{
    return all_crests(b);
}
#endif

/* Returns the number of points. The map needs more rows than half of ALONG, more inner columns than half of ACROSS,
 * and space for AT_ONCE more rows of `sums` than it has. */
long crests(const Bands *b)
{
#if defined(__x86_64__) && !defined(PLAIN)
    if (__builtin_cpu_supports("avx2"))
        return crests_fast(b);
#endif
    return crests_plain(b);
}
