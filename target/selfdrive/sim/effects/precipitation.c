/* Stands for: air.py, canvas.py, particles.py, windscreen.py.
 * Rain and snow in single precision, with sums in the same order as in Python and OpenCV's rounding. This must not
 * be used where OpenCV calculates differently. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#if defined(__x86_64__)
#define FAST __attribute__((target("avx2,fma")))
#else
#define FAST
#define IS_FAST 0
#endif
#ifndef IS_FAST /* tests set this */
#define IS_FAST (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#endif

enum { MARGIN = 2, GRIDS = 3, BLOCK = 32 };
#define SPACING 1.3f

/* --- Particles.streaks ------------------------------------------------------------------------------------ */

/* The moment of a picture, and the camera; single precision, like the arrays used with them. */
typedef struct {
    float fall_ahead, fall_down; /* shares of a box of 1 m per m/s of fall */
    float cx, cy, fx, fy, rows, width;
    float lean, upright, exposure;
    float driven_ahead, driven_down; /* m/s */
    float nearest, faintest, area;
} Moment;

/* `of` has five rows of n: reach, size, speed, across, down, ahead. */
typedef struct {
    const float *reach, *size, *speed, *across, *down, *ahead;
} Particles;

INLINE float larger(float one, float other) /* like NumPy's maximum: NaN is kept */
{
    return one >= other || one != one ? one : other;
}

INLINE float smaller(float one, float other)
{
    return one < other ? one : other;
}

/* Position of a particle as a share of its box, after its fall and the car's motion. */
INLINE float moved(float first, float speed, float reach, float fall, float driven)
{
    float place = speed * fall / reach;
    place = place + first;
    place = place + driven;
    return place - floorf(place);
}

/* Distances ahead and columns of the particles `from` to `to` - 1, all in one box. */
INLINE void places(const Particles *all, const Moment *m, float driven, long from, long to, float *ahead, float *left)
{
    for (long i = from; i < to; i++) {
        float reach = all->reach[i];
        float away = larger(moved(all->ahead[i], all->speed[i], reach, m->fall_ahead, driven) * reach, 1e-3f);
        ahead[i] = away;
        left[i] = m->cx + all->across[i] * reach / away;
    }
}

INLINE long seen_streaks(const float *of, long n, const long *counts, const float *driven, long boxes, const Moment *m,
                         float *out)
{
    Particles all = {of, of + n, of + 2 * n, of + 3 * n, of + 4 * n, of + 5 * n};
    float *ahead = out + 3 * n, *left = out + 4 * n; /* overwritten after being read */
    long found = 0;
    for (long box = 0, from = 0; box < boxes; from += counts[box++])
        places(&all, m, driven[2 * box], from, from + counts[box], ahead, left);
    for (long box = 0, i = 0; box < boxes; box++)
        for (long last = i + counts[box]; i < last; i++) {
            float away = ahead[i], column = left[i];
            if (!(away > m->nearest && column > -40.0f && column < m->width + 40.0f))
                continue;
            float reach = all.reach[i], speed = all.speed[i];
            float down = moved(all.down[i], speed, reach, m->fall_down, driven[2 * box + 1]);
            down = (down * m->rows - m->cy) * (reach / m->fy);
            float row = m->cy + m->fy * down / away;
            if (!(row < m->rows + (float)MARGIN))
                continue;
            float later = larger(away + m->exposure * (m->lean * speed - m->driven_ahead), 0.5f * m->nearest);
            float lower = down + m->exposure * (m->upright * speed + m->driven_down);
            float end_row = m->cy + m->fy * lower / later;
            if (!(end_row > (float)-MARGIN))
                continue;
            float end_column = m->cx + (column - m->cx) * away / later;
            float width = m->fx * all.size[i] / away;
            float across = end_column - column, length = end_row - row;
            length = sqrtf(across * across + length * length);
            if (!(m->area * (width * width) > m->faintest * (length + 1.0f)))
                continue;
            out[found] = column, out[n + found] = row, out[2 * n + found] = end_column;
            ahead[found] = end_row, left[found] = width;
            found++;
        }
    return found;
}

FAST static long streaks_fast(const float *of, long n, const long *counts, const float *driven, long boxes,
                              const Moment *m, float *out)
{
    return seen_streaks(of, n, counts, driven, boxes, m, out);
}

static long streaks_plain(const float *of, long n, const long *counts, const float *driven, long boxes, const Moment *m,
                          float *out)
{
    return seen_streaks(of, n, counts, driven, boxes, m, out);
}

/* The streaks of n particles: columns and rows of start and end, and widths; `out` has five rows of n. Boxes have
 * `counts` particles and have moved by the shares `driven`, ahead and down. Returns the number of streaks. */
long streaks(const float *of, long n, const long *counts, const float *driven, long boxes, const Moment *m, float *out)
{
    return (IS_FAST ? streaks_fast : streaks_plain)(of, n, counts, driven, boxes, m, out);
}

/* --- Cover.taken ------------------------------------------------------------------------------------------ */

typedef struct {
    long top, bottom, left, right;
} Region;

typedef struct {
    float across, down;
} Place;

/* A streak on its grid: first point, distance between points, a point's weight, and number of points. */
typedef struct {
    Place first, step, least, most;
    float share;
    long count;
} Stroke;

typedef struct {
    long place;
    float shares[4];
} Point;

typedef struct {
    Point *points; /* NULL if memory is exhausted */
    long count;
    int grids; /* those with streaks, one bit each */
} Drawn;

/* Add the streaks to the sheet. */
static Drawn draw(const float *start, const float *end, const float *widths, long n, const Region *windows,
                const Place *corners, const Place *ends, float area, float *sheet, long width)
{
    static const float scales[GRIDS] = {1.0f, 2.0f, 4.0f};
    Place least[GRIDS], most[GRIDS];
    for (int k = 0; k < GRIDS; k++) {
        Place corner = corners[k];
        least[k].across = larger((float)(windows[k].left - 1) + corner.across, corner.across);
        least[k].down = larger((float)(windows[k].top - 1) + corner.down, corner.down);
        most[k].across = smaller((float)windows[k].right + corner.across, ends[k].across);
        most[k].down = smaller((float)windows[k].bottom + corner.down, ends[k].down);
    }
    Stroke *strokes = malloc((size_t)(n + 1) * sizeof *strokes);
    Drawn drawn = {NULL, 0, 0};
    long near = 0, total = 0;
    for (long i = 0; strokes && i < n; i++) {
        int grid = widths[i] <= 1.5f ? 0 : widths[i] <= 3.0f ? 1 : 2;
        float scale = scales[grid];
        Place corner = {corners[grid].across + 1.5f, corners[grid].down + 1.5f};
        Place from = {(start[i] + 0.5f) / scale + corner.across, (start[n + i] + 0.5f) / scale + corner.down};
        Place to = {(end[i] + 0.5f) / scale + corner.across, (end[n + i] + 0.5f) / scale + corner.down};
        Place low = least[grid], high = most[grid];
        if (!(larger(from.across, to.across) >= low.across && smaller(from.across, to.across) < high.across &&
              larger(from.down, to.down) >= low.down && smaller(from.down, to.down) < high.down))
            continue;
        float across = to.across - from.across, down = to.down - from.down;
        long count = (long)(sqrtf(across * across + down * down) / SPACING) + 1;
        float points = (float)count, wide = widths[i] / scale;
        strokes[near++] =
            (Stroke){from, {across / points, down / points}, low, high, area * (wide * wide) / points, count};
        total += count;
        drawn.grids |= 1 << grid;
    }
    Point *points = strokes ? malloc((size_t)(total + 1) * sizeof *points) : NULL;
    for (long k = 0; points && k < near; k++) {
        const Stroke *stroke = &strokes[k];
        for (long number = 0; number < stroke->count; number++) {
            float at = (float)number + 0.5f;
            float column = stroke->first.across + stroke->step.across * at;
            float row = stroke->first.down + stroke->step.down * at;
            if (!(column >= stroke->least.across && column < stroke->most.across && row >= stroke->least.down &&
                  row < stroke->most.down))
                continue;
            long left = (long)column, top = (long)row; /* floor, because it is not negative */
            float right = column - (float)left, low = stroke->share * (row - (float)top), high = stroke->share - low;
            float high_right = high * right, low_right = low * right;
            points[drawn.count++] =
                (Point){top * width + left, {high - high_right, high_right, low - low_right, low_right}};
        }
    }
    const long beside[4] = {0, 1, width, width + 1};
    for (int corner = 0; corner < 4; corner++) /* in the order of the Python sums */
        for (long k = 0; k < drawn.count; k++)
            sheet[points[k].place + beside[corner]] += points[k].shares[corner];
    free(strokes);
    drawn.points = points;
    return drawn;
}

/* Clear the first `size` numbers of the sheet, which are those of the full grid. */
static void wipe(const Drawn *drawn, float *sheet, long width, long size)
{
    for (long k = 0; k < drawn->count; k++) {
        float *place = sheet + drawn->points[k].place;
        if (drawn->points[k].place < size)
            place[0] = place[1] = place[width] = place[width + 1] = 0.0f;
    }
}

INLINE long within(long place, long size)
{
    return place < 0 ? 0 : place < size ? place : size - 1;
}

/* Enlarge a row of single-precision numbers to twice its length. */
INLINE void widened(const float *from, long size, float *to)
{
    to[0] = from[0];
    for (long k = 0; k < size - 1; k++) {
        float step = from[k + 1] - from[k];
        to[2 * k + 1] = fmaf(step, 0.25f, from[k]);
        to[2 * k + 2] = fmaf(step, 0.75f, from[k]);
    }
    to[2 * size - 1] = from[size - 1];
}

/* The same for levels: the sums of four shares. */
INLINE void widened_levels(const uint8_t *from, long size, uint16_t *to)
{
    to[0] = (uint16_t)(4 * from[0]);
    for (long k = 0; k < size - 1; k++) {
        to[2 * k + 1] = (uint16_t)(3 * from[k] + from[k + 1]);
        to[2 * k + 2] = (uint16_t)(from[k] + 3 * from[k + 1]);
    }
    to[2 * size - 1] = (uint16_t)(4 * from[size - 1]);
}

INLINE uint8_t level_of(float share)
{
    float level = rintf(share * 255.0f);
    return level >= 255.0f ? 255 : (uint8_t)(int)level;
}

/* The window's position on the sheet. */
INLINE float *on_sheet(float *sheet, long width, Place corner, Region window)
{
    return sheet + ((long)corner.down + window.top) * width + (long)corner.across + window.left;
}

/* Add the quarter grid to the half grid; `two` has space for two enlarged rows. */
INLINE void add_quarter(float *half, const float *quarter, long width, Region fine, Region seen, float *two)
{
    long rows = seen.bottom - seen.top, size = seen.right - seen.left, columns = fine.right - fine.left;
    long down = fine.top + MARGIN - 2 * seen.top, right = fine.left + MARGIN - 2 * seen.left;
    float *made[2] = {two, two + 2 * size};
    long which[2] = {-1, -1};
    for (long y = 0; y < fine.bottom - fine.top; y++) {
        long upper = (y + down - 1) >> 1;
        const float *row[2];
        for (long k = 0; k < 2; k++) {
            long source = within(upper + k, rows);
            if (which[source & 1] != source) {
                widened(quarter + source * width, size, made[source & 1]);
                which[source & 1] = source;
            }
            row[k] = made[source & 1] + right;
        }
        float share = (y + down) & 1 ? 0.25f : 0.75f, *out = half + y * width;
        for (long x = 0; x < columns; x++)
            out[x] = out[x] + fmaf(row[1][x] - row[0][x], share, row[0][x]);
    }
}

/* Levels from the full grid and two rows of the half grid; most are 0. */
INLINE void add_block(const float *shares, const uint16_t *near, const uint16_t *far, long count, uint8_t *out)
{
    int any = 0;
    for (long x = 0; x < count; x++)
        any |= (shares[x] != 0.0f) | near[x] | far[x];
    if (!any) {
        memset(out, 0, (size_t)count);
        return;
    }
    for (long x = 0; x < count; x++) {
        int coarse = ((3 * near[x] >> 2) + (far[x] >> 2) + 2) >> 2, level = level_of(shares[x]) + coarse;
        out[x] = (uint8_t)(level < 255 ? level : 255);
    }
}

/* Levels from the full grid and the enlarged half grid. */
INLINE void add_up(const float *full, const float *half, long width, Region fine, Region seen, uint8_t *levels,
                   uint16_t *two, uint8_t *out)
{
    long rows = seen.bottom - seen.top, size = seen.right - seen.left, columns = fine.right - fine.left;
    long down = fine.top + MARGIN - 2 * seen.top, right = fine.left + MARGIN - 2 * seen.left;
    uint16_t *made[2] = {two, two + 2 * size};
    long which[2] = {-1, -1};
    for (long y = 0; y < fine.bottom - fine.top; y++, out += columns) {
        long upper = (y + down - 1) >> 1;
        const uint16_t *row[2];
        for (long k = 0; k < 2; k++) {
            long source = within(upper + k, rows);
            if (which[source & 1] != source) {
                const float *shares = half + source * width;
                int any = 0;
                for (long x = 0; x < size; x++)
                    any |= shares[x] != 0.0f;
                if (any) {
                    for (long x = 0; x < size; x++)
                        levels[x] = level_of(shares[x]);
                    widened_levels(levels, size, made[source & 1]);
                } else
                    memset(made[source & 1], 0, (size_t)(2 * size) * sizeof(uint16_t));
                which[source & 1] = source;
            }
            row[k] = made[source & 1] + right;
        }
        const uint16_t *near = row[!((y + down) & 1)], *far = row[(y + down) & 1];
        const float *shares = full + y * width;
        for (long x = 0; x < columns; x += BLOCK)
            if (columns - x >= BLOCK)
                add_block(shares + x, near + x, far + x, BLOCK, out + x);
            else
                add_block(shares + x, near + x, far + x, columns - x, out + x);
    }
}

INLINE void enlarge(float *sheet, long width, const Region *windows, const Place *corners, int on, float *scratch,
                    uint8_t *out)
{
    float *grids[GRIDS];
    for (int k = 0; k < GRIDS; k++)
        grids[k] = on_sheet(sheet, width, corners[k], windows[k]);
    if (on & 4)
        add_quarter(grids[1], grids[2], width, windows[1], windows[2], scratch);
    uint16_t *two = (uint16_t *)scratch;
    uint8_t *levels = (uint8_t *)(two + 4 * (windows[1].right - windows[1].left));
    add_up(grids[0], grids[1], width, windows[0], windows[1], levels, two, out);
}

FAST static void enlarge_fast(float *sheet, long width, const Region *windows, const Place *corners, int on,
                              float *scratch, uint8_t *out)
{
    enlarge(sheet, width, windows, corners, on, scratch, out);
}

static void enlarge_plain(float *sheet, long width, const Region *windows, const Place *corners, int on, float *scratch,
                          uint8_t *out)
{
    enlarge(sheet, width, windows, corners, on, scratch, out);
}

/* Shares of light that n streaks take, in units of 1/255, in the first of `windows`, which are on the full, half and
 * quarter grids. The grids are at `corners` of the sheet, up to `ends`. Returns 1 if memory is exhausted. */
long taken(const float *start, const float *end, const float *widths, long n, const Region *windows,
           const Place *corners, const Place *ends, float area, float *sheet, long width, uint8_t *out)
{
    for (int k = 1; k < GRIDS; k++) { /* the full grid has been cleared */
        float *row = on_sheet(sheet, width, corners[k], windows[k]);
        for (long y = windows[k].top; y < windows[k].bottom; y++, row += width)
            memset(row, 0, (size_t)(windows[k].right - windows[k].left) * sizeof *row);
    }
    Drawn drawn = draw(start, end, widths, n, windows, corners, ends, area, sheet, width);
    long columns = 1; /* enough for two rows of either enlarged grid and one row of levels */
    for (int k = 1; k < GRIDS; k++)
        columns += windows[k].right - windows[k].left;
    float *scratch = malloc((size_t)(4 * columns) * sizeof *scratch);
    int failed = !drawn.points || !scratch;
    if (!failed)
        (IS_FAST ? enlarge_fast : enlarge_plain)(sheet, width, windows, corners, drawn.grids, scratch, out);
    wipe(&drawn, sheet, width, (long)corners[1].down * width);
    free(drawn.points);
    free(scratch);
    return failed;
}

/* --- veiled and Windscreen -------------------------------------------------------------------------------- */

INLINE int share_of(int level, int share) /* rounded to nearest; there are no ties */
{
    int twice = level * share + 127;
    return (twice + 1 + (twice >> 8)) >> 8;
}

INLINE void veil_rows(const uint8_t *picture, long picture_step, const uint8_t *veil, long veil_step,
                      const uint8_t *taken, long rows, long columns, float slope, float air, uint8_t *out)
{
    for (long y = 0; y < rows; y++, picture += picture_step, veil += veil_step, taken += columns, out += columns)
        for (long x = 0; x < columns; x++) {
            int kept = share_of(veil[x], 255 - taken[x]);
            int lost = (int)rintf(fabsf(fmaf((float)kept, slope, air)));
            int level = share_of(picture[x], kept) + lost;
            out[x] = (uint8_t)(level < 255 ? level : 255);
        }
}

FAST static void veil_fast(const uint8_t *picture, long picture_step, const uint8_t *veil, long veil_step,
                           const uint8_t *taken, long rows, long columns, float slope, float air, uint8_t *out)
{
    veil_rows(picture, picture_step, veil, veil_step, taken, rows, columns, slope, air, out);
}

static void veil_plain(const uint8_t *picture, long picture_step, const uint8_t *veil, long veil_step,
                       const uint8_t *taken, long rows, long columns, float slope, float air, uint8_t *out)
{
    veil_rows(picture, picture_step, veil, veil_step, taken, rows, columns, slope, air, out);
}

/* A region of a picture after attenuation by veil and streaks; airlight replaces the lost light. Rows of `picture`
 * and `veil` are `picture_step` and `veil_step` apart. */
void veiled(const uint8_t *picture, long picture_step, const uint8_t *veil, long veil_step, const uint8_t *taken,
            long rows, long columns, float slope, float air, uint8_t *out)
{
    (IS_FAST ? veil_fast : veil_plain)(picture, picture_step, veil, veil_step, taken, rows, columns, slope, air, out);
}

enum { COARSE = 8 };

/* Means of 8 x 8 pixels; halves round to the even level. */
INLINE void mean_rows(const uint8_t *picture, long rows, long columns, uint16_t *sums, uint8_t *out)
{
    for (long y = 0; y < rows; y++, out += columns) {
        memset(sums, 0, (size_t)(columns * COARSE) * sizeof *sums);
        for (long k = 0; k < COARSE; k++, picture += COARSE * columns)
            for (long x = 0; x < COARSE * columns; x++)
                sums[x] = (uint16_t)(sums[x] + picture[x]);
        for (long x = 0; x < columns; x++) {
            int sum = 0;
            for (long k = 0; k < COARSE; k++)
                sum += sums[COARSE * x + k];
            out[x] = (uint8_t)((sum + 31 + (sum >> 6 & 1)) >> 6);
        }
    }
}

FAST static void mean_fast(const uint8_t *picture, long rows, long columns, uint16_t *sums, uint8_t *out)
{
    mean_rows(picture, rows, columns, sums, out);
}

static void mean_plain(const uint8_t *picture, long rows, long columns, uint16_t *sums, uint8_t *out)
{
    mean_rows(picture, rows, columns, sums, out);
}

/* The picture reduced to `rows` x `columns`; `sums` has space for a row of the picture. */
void coarse(const uint8_t *picture, long rows, long columns, uint16_t *sums, uint8_t *out)
{
    (IS_FAST ? mean_fast : mean_plain)(picture, rows, columns, sums, out);
}
