/* Stands for: band_filter.py.
 * What it does to single points of the map: the same operations in single precision, so the same bits. */

#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

enum { NEAR = 5, EDGE = 8, REACH = 2 }; /* columns to the sides of one line and of two; a crest's neighbours */
static const float DARK = 12.0f, LEAST = 0.006f, QUIET = 1.6f;

/* Contrast of bands and roughness of the inner points, from means of the map: `side` as wide as the road compared
 * with, `one` and `two` as wide as a mark of one line or two. */
INLINE void all_bands(const float *side, const float *one, const float *two, long rows, long width,
                      float *restrict contrast, float *restrict rough)
{
    long inner = width - 2 * EDGE;
    for (long y = 0; y < rows; y++) {
        const float *road = side + y * width + EDGE, *single = one + y * width + EDGE, *pair = two + y * width + EDGE;
        float *restrict of_row = contrast + y * inner, *restrict rough_row = rough + y * inner;
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

/* Numbers and weights of the points whose contrast is the highest around; `sure` is room for a row. */
INLINE long all_crests(const float *contrast, const float *texture, long rows, long inner, float scale,
                       float *restrict sure, int64_t *at, float *weight)
{
    long found = 0;
    for (long y = 0; y < rows; y++) {
        const float *row = contrast + y * inner, *rough = texture + y * inner;
        for (long x = 0; x < inner; x++)
            sure[x] = (row[x] / (rough[x] + LEAST) - QUIET) * scale;
        for (long x = 0; x < inner; x++) {
            if (!(sure[x] > 0.0f))
                continue;
            int highest = 1;
            for (long k = x > REACH ? x - REACH : 0; k <= x + REACH && k < inner; k++)
                highest &= row[x] >= row[k];
            at[found] = y * inner + x;
            weight[found] = sure[x] < 1.0f ? sure[x] : 1.0f;
            found += highest;
        }
    }
    return found;
}

static void bands_plain(const float *side, const float *one, const float *two, long rows, long width, float *contrast,
                        float *rough)
{
    all_bands(side, one, two, rows, width, contrast, rough);
}

static long crests_plain(const float *contrast, const float *texture, long rows, long inner, float scale, float *sure,
                         int64_t *at, float *weight)
{
    return all_crests(contrast, texture, rows, inner, scale, sure, at, weight);
}

#if defined(__x86_64__) && !defined(PLAIN)
#define FAST __attribute__((target("avx2")))
#define CHOOSE(name, ...) __builtin_cpu_supports("avx2") ? name##_fast(__VA_ARGS__) : name##_plain(__VA_ARGS__)

FAST static void bands_fast(const float *side, const float *one, const float *two, long rows, long width,
                            float *contrast, float *rough)
{
    all_bands(side, one, two, rows, width, contrast, rough);
}

FAST static long crests_fast(const float *contrast, const float *texture, long rows, long inner, float scale,
                             float *sure, int64_t *at, float *weight)
{
    return all_crests(contrast, texture, rows, inner, scale, sure, at, weight);
}
#else
#define CHOOSE(name, ...) name##_plain(__VA_ARGS__)
#endif

void bands(const float *side, const float *one, const float *two, long rows, long width, float *contrast, float *rough)
{
    CHOOSE(bands, side, one, two, rows, width, contrast, rough);
}

/* Returns how many there are. */
long crests(const float *contrast, const float *texture, long rows, long inner, float scale, float *sure, int64_t *at,
            float *weight)
{
    return CHOOSE(crests, contrast, texture, rows, inner, scale, sure, at, weight);
}
