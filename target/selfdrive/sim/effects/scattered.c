/* Stands for: scattered.py.
 * Randomly placed streaks, flakes and droplets, with NumPy's random numbers. */

#include <stdint.h>
#include <string.h>

typedef struct {
    long column, row;
} Pixel;

/* Add passes of `count` streaks each to a region of a canvas, as levels. `chances` are the starts of streaks as
 * shares of the canvas's `size`; the region begins at `first`. A streak has `length` pixels and ends at `way`
 * relative to its start. A pass lights a pixel at most once. `light` and `passed` are initially zero, and as large
 * as the region with a `margin` around it. */
void streaks(const float *chances, long passes, long count, const Pixel *size, const Pixel *first, const Pixel *pixels,
             long length, const Pixel *way, const uint8_t *levels, long rows, long columns, long margin, uint8_t *light,
             uint8_t *passed)
{
    long width = columns + 2 * margin;
    for (long pass = 0; pass < passes; pass++)
        for (long k = 0; k < count; k++, chances += 2) {
            long column = (long)((double)chances[0] * (double)size->column) - first->column;
            long row = (long)((double)chances[1] * (double)size->row) - first->row;
            if (column + way->column >= columns || column < 0 || row + way->row < 0 || row >= rows)
                continue;
            long start = (row + margin) * width + column + margin;
            for (long n = 0; n < length; n++) {
                long at = start + pixels[n].row * width + pixels[n].column;
                if (passed[at] != pass + 1) {
                    int sum = light[at] + levels[pass];
                    light[at] = (uint8_t)(sum < 255 ? sum : 255);
                    passed[at] = (uint8_t)(pass + 1);
                }
            }
        }
}

/* Add flakes of `size` x `size` levels, equal within a layer, that begin at pixels `first` to `end` - 1, in rows of
 * `columns` pixels. `places` are their starts, `count` per layer; `light` begins at pixel `first`. */
void flakes(const int64_t *places, long layers, long count, const uint16_t *levels, long size, long columns, long first,
            long end, uint16_t *light)
{
    for (long layer = 0; layer < layers; layer++, levels += size * size)
        for (long k = 0; k < count; k++) {
            int64_t place = *places++;
            if (place < first || place >= end)
                continue;
            uint16_t *row = light + (place - first);
            for (long y = 0; y < size; y++, row += columns)
                for (long x = 0; x < size; x++)
                    row[x] = (uint16_t)(row[x] + levels[y * size + x]);
        }
}

/* M. O'Neill's generator PCG64 (XSL RR 128/64) as in NumPy: four numbers at a time, because each step has a long
 * latency. */
enum { AT_ONCE = 4 };
typedef unsigned __int128 Wide;

static uint64_t output(Wide state)
{
    uint64_t mixed = (uint64_t)(state >> 64) ^ (uint64_t)state;
    unsigned turn = (unsigned)(state >> 122);
    return mixed >> turn | mixed << (-turn & 63);
}

/* Make pixels white: `count` draws from `bound` pixels, as NumPy draws integers (D. Lemire, 2019). `generator` has
 * the upper and lower halves of its state and of its increment. If `kept` is not negative, it is a 32-bit number
 * that is used first. */
void droplets(const uint64_t *generator, int64_t kept, long count, uint32_t bound, uint8_t *pixels)
{
    const Wide by = (Wide)2549297995355413924u << 64 | 4865540595714422341u;
    Wide increment = (Wide)generator[2] << 64 | generator[3], far = 1, add = 0, states[AT_ONCE];
    states[0] = (Wide)generator[0] << 64 | generator[1];
    for (int k = 0; k < AT_ONCE; k++) {
        states[k] = (k ? states[k - 1] : states[0]) * by + increment;
        far = far * by, add = add * by + increment;
    }
    const uint32_t threshold = -bound % bound; /* smaller remainders would bias the result */
    uint32_t numbers[2 * AT_ONCE + 1];
    while (count) {
        int made = 0;
        if (kept >= 0)
            numbers[made++] = (uint32_t)kept;
        kept = -1;
        for (int k = 0; k < AT_ONCE; k++, made += 2) {
            uint64_t number = output(states[k]);
            numbers[made] = (uint32_t)number, numbers[made + 1] = (uint32_t)(number >> 32);
            states[k] = states[k] * far + add;
        }
        for (int k = 0; k < made && count; k++) {
            uint64_t product = (uint64_t)numbers[k] * bound;
            if ((uint32_t)product >= threshold)
                pixels[product >> 32] = 255, count--;
        }
    }
}
