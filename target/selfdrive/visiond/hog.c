/* Stands for: hog.py.
 * Its two slow steps. The same operations in the same order, so the same bits: a cell's votes are added in
 * double precision, pixel by pixel, row by row. */

#include <stdint.h>
#include <string.h>

enum { CELL = 4, BINS = 9, STEPS = 511, LARGEST = 255 };

/* Votes of each cell (rows / 4, width / 4, 9) of a picture. `orientation` and `length` are the tables of all
 * gradients; `sums` is room for a row of cells. Beyond its border a picture is mirrored at the outer pixels,
 * so across the border there is no gradient. */
void votes(const uint8_t *picture, long rows, long width, const uint8_t *orientation, const double *length,
           double *sums, float *cells)
{
    long in_row = width / CELL * BINS;
    for (long top = 0; top < rows; top += CELL) {
        memset(sums, 0, in_row * sizeof *sums);
        for (long y = top; y < top + CELL; y++) {
            const uint8_t *row = picture + y * width;
            const uint8_t *above = y > 0 ? row - width : row + width;
            const uint8_t *below = y < rows - 1 ? row + width : row - width;
            for (long x = 0; x < width; x++) {
                int dx = row[x < width - 1 ? x + 1 : x - 1] - row[x > 0 ? x - 1 : x + 1];
                int dy = below[x] - above[x];
                long gradient = (long)(dy + LARGEST) * STEPS + dx + LARGEST;
                sums[x / CELL * BINS + orientation[gradient]] += length[gradient];
            }
        }
        for (long k = 0; k < in_row; k++)
            *cells++ = (float)sums[k];
    }
}

/* Blocks (down, right, 36): the four cells of each, all multiplied by the block's `scale`. */
void blocks(const float *cells, const float *scale, long down, long right, float *out)
{
    for (long y = 0; y < down; y++)
        for (long x = 0; x < right; x++) {
            float by = scale[y * right + x];
            for (long lower = 0; lower < 2; lower++) {
                const float *pair = cells + ((y + lower) * (right + 1) + x) * BINS;
                for (long k = 0; k < 2 * BINS; k++)
                    *out++ = pair[k] * by;
            }
        }
}
