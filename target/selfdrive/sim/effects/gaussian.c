/* Stands for: gaussian.py.
 * A separable blur of bytes with integer weights whose sum is 256, as in OpenCV. All sums fit into sixteen bits:
 * vertical sums are stored as high and low bytes. */

#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#if defined(__x86_64__)
#define FAST __attribute__((target("avx2")))
#else
#define FAST
#define IS_FAST 0
#endif
#ifndef IS_FAST /* tests set this */
#define IS_FAST __builtin_cpu_supports("avx2")
#endif

enum { LANES = 16, LINE = 32, MOST_REACH = 32 };
typedef uint16_t Lanes __attribute__((vector_size(2 * LANES)));

typedef struct {
    const uint8_t *pixels;
    long step, rows, columns;
} Picture;

/* Distance between rows: an odd number of cache lines, so that rows do not evict each other from the cache. */
INLINE long padded(long columns)
{
    return ((columns + LINE - 1) / LINE | 1) * LINE;
}

/* Add `weight` times the numbers at both positions. */
#define WEIGH(sums, weight, one, other)                                                                               \
    do {                                                                                                              \
        Lanes here, there;                                                                                            \
        memcpy(&here, one, sizeof here);                                                                              \
        memcpy(&there, other, sizeof there);                                                                          \
        sums += (here + there) * (weight);                                                                            \
    } while (0)

#define WEIGH_MIDDLE(sums, weight, middle)                                                                            \
    do {                                                                                                              \
        memcpy(&sums, middle, sizeof sums);                                                                           \
        sums *= (weight);                                                                                             \
    } while (0)

/* Sums along a row, as high and low bytes. `wide` has space for the row and `reach` more at either end. */
INLINE void along(const Picture *picture, long row, const uint16_t *kernel, long reach, uint16_t *wide, uint16_t *high,
                  uint16_t *low)
{
    long columns = picture->columns;
    const uint8_t *pixels = picture->pixels + row * picture->step;
    for (long x = 0; x < columns; x++)
        wide[reach + x] = pixels[x];
    for (long k = 1; k <= reach; k++) {
        wide[reach - k] = pixels[k];
        wide[reach + columns - 1 + k] = pixels[columns - 1 - k];
    }
    for (long x = 0; x < columns; x += LANES) {
        Lanes sums;
        WEIGH_MIDDLE(sums, kernel[reach], wide + reach + x);
        for (long k = 0; k < reach; k++)
            WEIGH(sums, kernel[k], wide + x + k, wide + x + 2 * reach - k);
        Lanes upper = sums >> 8, lower = sums & 255;
        memcpy(high + x, &upper, sizeof upper);
        memcpy(low + x, &lower, sizeof lower);
    }
}

INLINE long mirrored(long row, long rows)
{
    return row < 0 ? -row : row < rows ? row : 2 * rows - 2 - row;
}

INLINE void blur(const Picture *picture, const uint16_t *kernel, long reach, uint16_t *room, uint8_t *out)
{
    long columns = picture->columns, rows = picture->rows, size = 2 * reach + 1, stride = padded(columns), made = 0;
    long at[2 * MOST_REACH + 1];
    uint16_t *wide = room, *levels = wide + stride + 2 * reach;
    uint16_t *high = levels + stride, *low = high + size * stride; /* of the last `size` rows */
    for (long y = 0; y < rows; y++, out += columns) {
        for (; made <= y + reach && made < rows; made++) {
            long next = made % size * stride;
            along(picture, made, kernel, reach, wide, high + next, low + next);
        }
        for (long k = 0; k < size; k++)
            at[k] = mirrored(y - reach + k, rows) % size * stride;
        for (long x = 0; x < columns; x += LANES) {
            Lanes sums, low_sums;
            WEIGH_MIDDLE(sums, kernel[reach], high + at[reach] + x);
            WEIGH_MIDDLE(low_sums, kernel[reach], low + at[reach] + x);
            for (long k = 0; k < reach; k++) {
                WEIGH(sums, kernel[k], high + at[k] + x, high + at[size - 1 - k] + x);
                WEIGH(low_sums, kernel[k], low + at[k] + x, low + at[size - 1 - k] + x);
            }
            sums = (sums + (low_sums >> 8) + 128) >> 8;
            memcpy(levels + x, &sums, sizeof sums);
        }
        for (long x = 0; x < columns; x++)
            out[x] = (uint8_t)levels[x];
    }
}

FAST static void blur_fast(const Picture *picture, const uint16_t *kernel, long reach, uint16_t *room, uint8_t *out)
{
    blur(picture, kernel, reach, room, out);
}

static void blur_plain(const Picture *picture, const uint16_t *kernel, long reach, uint16_t *room, uint8_t *out)
{
    blur(picture, kernel, reach, room, out);
}

/* Blur a picture larger than `reach` (at most MOST_REACH), with rows `step` apart. `kernel` is one half of the
 * kernel and its middle. `room` has space for 4 * reach + 4 rows, each longer than the picture's by 2 * reach + 64. */
void gaussian(const uint8_t *pixels, long step, long rows, long columns, const uint16_t *kernel, long reach,
              uint16_t *room, uint8_t *out)
{
    Picture picture = {pixels, step, rows, columns};
    (IS_FAST ? blur_fast : blur_plain)(&picture, kernel, reach, room, out);
}
