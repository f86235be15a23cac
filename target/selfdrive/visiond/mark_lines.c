/* Stands for: mark_edges.py, dbscan.py, edge_lines.py, paper_detector.py, ../common/array_math.py, ../common/camera_model.py, sums.h.
 * Edges of a picture, their clusters, and the lines next to the car: the same numbers as in Python to the bit.
 * Pixels and clusters are integers; everything else uses the same operations in the same order, and numpy's order
 * of sums. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "sums.h"

enum { STRIDE = 16, EPS = 4, SQUARE = 2 * EPS + 1, MIN_SAMPLES = 8, NEED = 2, MIN_PIXELS = 24, TRIES = 8 };
enum { NONE = INT32_MAX };
static const double MIN_SPREAD = 3.0, MAX_SLOPE = 0.15, BESIDE = 8.0, CROWD = 0.8, REACHES[] = {0.3, 0.2};
static const double LEAST_SHARE = 0.12, THINNEST = 0.03, WIDEST = 0.45, SHARP = 0.05;

/* Edge pixels on the road: position in the picture, m per pixel, whether it gets brighter to the right. */
typedef struct {
    double *row, *column, *scale;
    uint8_t *rising;
} Points;

/* Pictures of one size, their camera, and memory for one picture's data. */
typedef struct {
    int64_t rows, width, first_row, first_column;
    double cx, horizon, cos_pitch, tan_pitch, fx, fy, height, fx_cos;
    const double *scale; /* m per pixel, per row */
    const uint8_t *windows; /* those on the road */
    int16_t *gradient;      /* horizontal */
    int32_t *sums;          /* of squared gradients, per tile */
    float *limits;          /* of steep squared gradients */
    uint8_t *looked_at;     /* windows with steep edges, then those with a mark */
    int32_t *at, *label;    /* of each edge: pixel and cluster */
    uint8_t *mask;          /* rows + 8, width + 8; then one per row */
    uint8_t *crowd;         /* rows, width */
    int32_t *number;        /* rows, width: cluster of a core pixel */
    int32_t *run;           /* 4 per run of pixels: first and last column, row, root */
    int32_t *named;         /* cluster of each run */
    double *sum;            /* 5 per cluster: pixels, mean row and column, and two sums of squares */
    double *room;           /* 5 per pixel */
    Points all, own;
    int64_t count;          /* edges */
    double lines[2][8];     /* left and right: 1 if there is one, then FittedLine */
} Paper;

/* The Sobel operator, and tile sums of its squares. The picture is mirrored at its border. */
INLINE void sobel(Paper *p, const uint8_t *restrict part)
{
    long rows = p->rows, width = p->width, tiles = width / STRIDE;
    int16_t *restrict smooth = (int16_t *)p->room;
    memset(p->sums, 0, rows / STRIDE * tiles * sizeof *p->sums);
    for (long y = 0; y < rows; y++) {
        const uint8_t *row = part + y * width;
        const uint8_t *above = y > 0 ? row - width : row + width, *below = y < rows - 1 ? row + width : row - width;
        int16_t *restrict gradient = p->gradient + y * width;
        int32_t *restrict sums = p->sums + y / STRIDE * tiles;
        for (long x = 0; x < width; x++)
            smooth[x] = (int16_t)(above[x] + 2 * row[x] + below[x]);
        for (long x = 1; x < width - 1; x++)
            gradient[x] = (int16_t)(smooth[x + 1] - smooth[x - 1]);
        gradient[0] = gradient[width - 1] = 0;
        for (long tile = 0; tile < tiles; tile++) {
            int32_t sum = 0;
            for (long k = 0; k < STRIDE; k++)
                sum += (int32_t)gradient[tile * STRIDE + k] * gradient[tile * STRIDE + k];
            sums[tile] += sum;
        }
    }
}

/* The largest integer whose square is not above the limit. */
INLINE int16_t root_of(float limit)
{
    int32_t root = (int32_t)sqrtf(limit);
    while ((float)(root * root) > limit)
        root--;
    while ((float)((root + 1) * (root + 1)) <= limit)
        root++;
    return root > INT16_MAX ? INT16_MAX : (int16_t)root;
}

/* Pixels above the limit of their tile, in order, and the windows on the road that contain one. */
INLINE void steep(Paper *p)
{
    long width = p->width, tiles = width / STRIDE, down = p->rows / STRIDE - 1, across = tiles - 1, count = 0;
    uint8_t *restrict flags = (uint8_t *)p->room;
    int16_t *restrict most = (int16_t *)(flags + width);
    int32_t *restrict at = p->at;
    memset(p->looked_at, 0, down * across);
    for (long y = 0; y < p->rows; y++) {
        const int16_t *gradient = p->gradient + y * width;
        if (y % STRIDE == 0)
            for (long x = 0; x < width; x++)
                most[x] = x % STRIDE ? most[x - 1] : root_of(p->limits[y / STRIDE * tiles + x / STRIDE]);
        for (long x = 0; x < width; x++)
            flags[x] = (gradient[x] > most[x]) | (gradient[x] < -most[x]);
        for (long tile = 0; tile < tiles; tile++) {
            long before = count;
            for (long x = tile * STRIDE; x < (tile + 1) * STRIDE; x += 8) {
                uint64_t any;
                memcpy(&any, flags + x, sizeof any);
                if (any)
                    for (long k = 0; k < 8; k++) {
                        at[count] = (int32_t)(y * width + x + k);
                        count += flags[x + k];
                    }
            }
            if (count > before) {
                long row = y / STRIDE;
                for (long wy = row > 0 ? row - 1 : 0; wy <= row && wy < down; wy++)
                    for (long wx = tile > 0 ? tile - 1 : 0; wx <= tile && wx < across; wx++)
                        p->looked_at[wy * across + wx] = p->windows[wy * across + wx];
            }
        }
    }
    p->count = count;
}

/* Remove the edges in tiles that too few windows with a mark cover. */
INLINE void in_marks(Paper *p)
{
    long width = p->width, tiles = width / STRIDE, down = p->rows / STRIDE - 1, across = tiles - 1, count = 0;
    uint8_t *cover = (uint8_t *)p->room;
    memset(cover, 0, (down + 1) * tiles);
    for (long y = 0; y < down; y++)
        for (long x = 0; x < across; x++)
            if (p->looked_at[y * across + x])
                for (long k = 0; k < 4; k++)
                    cover[(y + k / 2) * tiles + x + k % 2]++;
    long y = 0, end = width;
    for (long k = 0; k < p->count; k++) {
        int32_t at = p->at[k];
        while (at >= end)
            y++, end += width;
        p->at[count] = at;
        count += cover[y / STRIDE * tiles + (at - (end - width)) / STRIDE] >= NEED;
    }
    p->count = count;
}

/* Number of edges in the square around each pixel; only for rows with edges. */
INLINE void crowds(Paper *p, const uint8_t *has_edges)
{
    long width = p->width, step = width + 2 * EPS;
    uint8_t *restrict down = (uint8_t *)p->room, *restrict two = down + step + 16, *restrict four = two + step + 16;
    memset(down, 0, step);
    for (long y = -EPS; y < p->rows; y++) {
        const uint8_t *more = p->mask + (y + 2 * EPS) * step;
        for (long x = 0; x < step; x++)
            down[x] = (uint8_t)(down[x] + more[x]);
        if (y > 0) {
            const uint8_t *less = p->mask + (y - 1) * step;
            for (long x = 0; x < step; x++)
                down[x] = (uint8_t)(down[x] - less[x]);
        }
        if (y < 0 || !has_edges[y])
            continue;
        uint8_t *restrict crowd = p->crowd + y * width;
        for (long x = 0; x < step - 1; x++)
            two[x] = (uint8_t)(down[x] + down[x + 1]);
        for (long x = 0; x < step - 3; x++)
            four[x] = (uint8_t)(two[x] + two[x + 2]);
        for (long x = 0; x < width; x++)
            crowd[x] = (uint8_t)(four[x] + four[x + 4] + down[x + 8]);
    }
}

INLINE int32_t root(int32_t *run, int32_t k)
{
    while (run[4 * k + 3] != k)
        k = run[4 * k + 3] = run[4 * run[4 * k + 3] + 3];
    return k;
}

/* Link runs of core pixels in a row, at most EPS apart, with those of the rows above. */
static int32_t linked_runs(Paper *p)
{
    long width = p->width;
    int32_t *run = p->run, count = 0;
    for (long k = 0; k < p->count;) {
        int32_t row = (int32_t)(p->at[k] / width), start = row * (int32_t)width, begin = count;
        for (; k < p->count && p->at[k] < start + width; k++) {
            int32_t column = p->at[k] - start;
            if (p->crowd[p->at[k]] < MIN_SAMPLES)
                continue;
            if (count > begin && column - run[4 * count - 3] <= EPS) {
                run[4 * count - 3] = column;
            } else {
                int32_t *one = run + 4 * count;
                one[0] = one[1] = column, one[2] = row, one[3] = count;
                count++;
            }
        }
        int32_t other = begin;
        while (other > 0 && run[4 * (other - 1) + 2] >= row - EPS)
            other--;
        for (int32_t upper = other; upper < begin;) { /* the rows above, one by one */
            int32_t above = run[4 * upper + 2], here = begin;
            while (upper < begin && run[4 * upper + 2] == above && here < count) {
                int32_t *a = run + 4 * upper, *b = run + 4 * here;
                if (a[0] <= b[1] + EPS && b[0] <= a[1] + EPS) {
                    int32_t x = root(run, upper), y = root(run, here);
                    run[4 * (x > y ? x : y) + 3] = x > y ? y : x;
                }
                if (a[1] < b[1])
                    upper++;
                else
                    here++;
            }
            while (upper < begin && run[4 * upper + 2] == above)
                upper++;
        }
    }
    return count;
}

/* The first cluster with a core pixel within EPS of a pixel; -1 if there is none. */
INLINE int32_t nearest_cluster(const Paper *p, int32_t at)
{
    long y = at / p->width, x = at - y * p->width;
    long top = y > EPS ? y - EPS : 0, bottom = y + EPS < p->rows ? y + EPS : p->rows - 1;
    long left = x > EPS ? x - EPS : 0, right = x + EPS < p->width ? x + EPS : p->width - 1;
    int32_t first = NONE;
    for (y = top; y <= bottom; y++)
        for (x = left; x <= right; x++)
            first = p->number[y * p->width + x] < first ? p->number[y * p->width + x] : first;
    return first == NONE ? -1 : first;
}

/* DBSCAN: the cluster of each edge, -1 for outliers. Clusters are numbered by their first core pixel, and a pixel at
 * the edge of several belongs to the first. Returns their number. */
INLINE int32_t clusters(Paper *p)
{
    long width = p->width, step = width + 2 * EPS;
    uint8_t *has_edges = p->mask + (p->rows + 2 * EPS) * step;
    memset(has_edges, 0, p->rows);
    for (long k = 0; k < p->count; k++) {
        long y = p->at[k] / width;
        has_edges[y] = 1;
        p->mask[(y + EPS) * step + EPS + p->at[k] - y * width] = 1;
    }
    crowds(p, has_edges);
    int32_t *run = p->run, *named = p->named, runs = linked_runs(p), found = 0, here = 0;
    for (int32_t k = 0; k < runs; k++) {
        int32_t first = root(run, k);
        named[k] = first == k ? found++ : named[first];
    }
    for (long k = 0; k < p->count; k++) {
        int32_t at = p->at[k], y = (int32_t)(at / width), x = (int32_t)(at - y * width);
        p->mask[(y + EPS) * step + EPS + x] = 0; /* restored */
        p->label[k] = -1;
        if (p->crowd[at] < MIN_SAMPLES)
            continue;
        while (run[4 * here + 2] != y || run[4 * here + 1] < x)
            here++;
        p->label[k] = p->number[at] = named[here];
    }
    for (long k = 0; k < p->count; k++)
        if (p->label[k] < 0)
            p->label[k] = nearest_cluster(p, p->at[k]);
    for (long k = 0; k < p->count; k++)
        p->number[p->at[k]] = NONE;
    return found;
}

INLINE void on_road(const Paper *p, double a, double b, double *y, double *slope)
{
    *slope = (p->cx - a * p->horizon - b) * p->cos_pitch / p->fx;
    *y = -a * p->fy * p->height / p->fx_cos + *slope * p->height * p->tan_pitch;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(const double *values, long count, double *room)
{
    memcpy(room, values, count * sizeof *room);
    qsort(room, count, sizeof *room, ascending);
    return count % 2 ? room[count / 2] : (room[count / 2 - 1] + room[count / 2]) / 2.0;
}

static double deviation(const double *values, long count, double *room)
{
    double mean = sum_of(values, count) / (double)count;
    for (long k = 0; k < count; k++)
        room[k] = (values[k] - mean) * (values[k] - mean);
    return sqrt(sum_of(room, count) / (double)count);
}

static double mean_distance(const double *brighter, long up, const double *darker, long down)
{
    return sum_of(darker, down) / (double)down - sum_of(brighter, up) / (double)up;
}

static int is_paint(const double *brighter, long up, const double *darker, long down)
{
    double width = mean_distance(brighter, up, darker, down);
    return THINNEST <= width && width <= WIDEST;
}

static int is_sharp_paint(const double *brighter, long up, const double *darker, long down, double least, double *room)
{
    return (double)(up < down ? up : down) >= least && deviation(brighter, up, room) <= SHARP &&
           deviation(darker, down, room) <= SHARP && is_paint(brighter, up, darker, down);
}

/* See _is_mark; `room` has space for four times as many values. `kinds` becomes the share of the rarer kind of edge,
 * and the distance between both. */
static int is_mark(const double *away, const uint8_t *rising, long count, double *room, double *kinds)
{
    double *brighter = room, *darker = room + count, *some = room + 2 * count, *more = room + 3 * count;
    long up = 0, down = 0, kept = 0;
    for (long k = 0; k < count; k++) {
        brighter[up] = away[k], darker[down] = away[k];
        up += rising[k], down += !rising[k];
    }
    double least = LEAST_SHARE * (double)count;
    if ((double)(up < down ? up : down) < least)
        return 0;
    kinds[0] = (double)(up < down ? up : down) / (double)count;
    kinds[1] = mean_distance(brighter, up, darker, down);
    if (is_paint(brighter, up, darker, down))
        return 1;
    double middle = median(brighter, up, more);
    for (long k = 0; k < down; k++) {
        some[kept] = darker[k];
        kept += darker[k] > middle;
    }
    if (is_sharp_paint(brighter, up, some, kept, least, more))
        return 1;
    middle = median(darker, down, more);
    kept = 0;
    for (long k = 0; k < up; k++) {
        some[kept] = brighter[k];
        kept += brighter[k] < middle;
    }
    return is_sharp_paint(some, kept, darker, down, least, more);
}

/* The line through all edges near column = a * row + b: 1, then FittedLine. Returns the number of edges, or 0. */
static long line_about(Paper *p, double a, double b, long all, double *line)
{
    const Points *from = &p->all;
    Points *own = &p->own;
    double *away = p->room, *room = p->room + p->rows * p->width, spread = 0.0, y, slope;
    long count = all;
    for (int k = 0; k < 2; k++) {
        long kept = 0;
        for (long i = 0; i < count; i++) {
            double off = from->column[i] - a * from->row[i];
            away[i] = fabs((off - b) * from->scale[i]);
        }
        for (long i = 0; i < count; i++) {
            own->row[kept] = from->row[i], own->column[kept] = from->column[i];
            own->scale[kept] = from->scale[i], own->rising[kept] = from->rising[i];
            kept += away[i] <= REACHES[k];
        }
        if (kept < MIN_PIXELS)
            return 0;
        from = own, count = kept;
        double mean_row = sum_of(own->row, count) / (double)count;
        double mean_column = sum_of(own->column, count) / (double)count;
        for (long i = 0; i < count; i++)
            away[i] = own->row[i] - mean_row;
        double power = dot(away, away, count, room);
        a = dot(away, own->column, count, room) / (power > 1.0 ? power : 1.0);
        spread = sqrt(power / (double)count);
        b = mean_column - a * mean_row;
    }
    on_road(p, a, b, &y, &slope);
    for (long i = 0; i < count; i++) {
        double off = own->column[i] - a * own->row[i];
        away[i] = (off - b) * own->scale[i];
    }
    if (spread < MIN_SPREAD || fabs(slope) > MAX_SLOPE || !is_mark(away, own->rising, count, room, line + 6))
        return 0;
    line[0] = 1.0, line[1] = y, line[2] = slope, line[3] = (double)count, line[4] = spread;
    line[5] = dot(away, away, count, room) / (double)count;
    return count;
}

/* Edges in clusters, as points on the road, and sums of each cluster. Returns the number of points. */
INLINE long points_of(Paper *p, int32_t found)
{
    long count = 0, y = 0, end = p->width;
    Points *all = &p->all;
    int32_t *label = p->label;
    for (long k = 0; k < p->count; k++) {
        while (p->at[k] >= end)
            y++, end += p->width;
        all->row[count] = (double)(y + p->first_row);
        all->column[count] = (double)(p->at[k] - (end - p->width) + p->first_column);
        all->scale[count] = p->scale[y];
        all->rising[count] = p->gradient[p->at[k]] > 0;
        label[count] = label[k];
        count += label[k] >= 0;
    }
    memset(p->sum, 0, 5 * found * sizeof *p->sum);
    for (long k = 0; k < count; k++) {
        double *sum = p->sum + 5 * label[k];
        sum[0] += 1.0, sum[1] += all->row[k], sum[2] += all->column[k];
    }
    for (int32_t k = 0; k < found; k++)
        p->sum[5 * k + 1] /= p->sum[5 * k], p->sum[5 * k + 2] /= p->sum[5 * k];
    for (long k = 0; k < count; k++) {
        double *sum = p->sum + 5 * label[k], down = all->row[k] - sum[1], right = all->column[k] - sum[2];
        sum[3] += down * down, sum[4] += down * right;
    }
    return count;
}

/* The clusters on one side of the car, from the nearest: m away, a, b of each. Returns their number. */
INLINE int nearest_on(const Paper *p, double side, int32_t found, double near[TRIES][3])
{
    int count = 0;
    for (int32_t k = 0; k < found; k++) {
        const double *sum = p->sum + 5 * k;
        double y, slope, power = sum[3], a = sum[4] / (power > 1.0 ? power : 1.0), b = sum[2] - a * sum[1];
        on_road(p, a, b, &y, &slope);
        double away = side * (y + BESIDE * slope);
        if (!(sum[0] >= MIN_PIXELS && sqrt(power / sum[0]) >= MIN_SPREAD && fabs(slope) <= MAX_SLOPE && away >= 0.0))
            continue;
        if (count == TRIES && !(away < near[TRIES - 1][0]))
            continue;
        int at = count < TRIES ? count++ : TRIES - 1;
        for (; at > 0 && away < near[at - 1][0]; at--)
            memcpy(near[at], near[at - 1], sizeof near[at]);
        near[at][0] = away, near[at][1] = a, near[at][2] = b;
    }
    return count;
}

INLINE void lines(Paper *p, int32_t found)
{
    long count = points_of(p, found);
    for (int side = 0; side < 2; side++) {
        double near[TRIES][3], first = 0.0, where = 0.0, *best = p->lines[side], line[8];
        int tries = nearest_on(p, side ? -1.0 : 1.0, found, near);
        long most = 0;
        memset(best, 0, sizeof p->lines[side]);
        for (int k = 0; k < tries; k++) {
            double away = near[k][0];
            if (best[0] != 0.0 && (away > first + CROWD || away < where + REACHES[0]))
                continue;
            long pixels = line_about(p, near[k][1], near[k][2], count, line);
            if (pixels > most) {
                first = best[0] != 0.0 ? first : away;
                memcpy(best, line, sizeof line);
                most = pixels, where = away;
            }
        }
    }
}

INLINE void all_lines(Paper *p)
{
    in_marks(p);
    lines(p, clusters(p));
}

static void sobel_plain(Paper *p, const uint8_t *part)
{
    sobel(p, part);
}

static void steep_plain(Paper *p)
{
    steep(p);
}

static void lines_plain(Paper *p)
{
    all_lines(p);
}

#if defined(__x86_64__) && !defined(PLAIN)
#define FAST __attribute__((target("avx2")))
#define CHOOSE(name, ...) __builtin_cpu_supports("avx2") ? name##_fast(__VA_ARGS__) : name##_plain(__VA_ARGS__)

FAST static void sobel_fast(Paper *p, const uint8_t *part)
{
    sobel(p, part);
}

FAST static void steep_fast(Paper *p)
{
    steep(p);
}

FAST static void lines_fast(Paper *p)
{
    all_lines(p);
}
#else
#define CHOOSE(name, ...) name##_plain(__VA_ARGS__)
#endif

/* First step: gradients of `part`, and sums of the tiles. */
void take_gradients(Paper *p, const uint8_t *part)
{
    CHOOSE(sobel, p, part);
}

/* Second: edges above the `limits`, and the windows to examine. */
void take_edges(Paper *p)
{
    CHOOSE(steep, p);
}

/* Third: lines through edges in windows with a mark. */
void take_lines(Paper *p)
{
    CHOOSE(lines, p);
}
