/* Stands for: authors_code_detector.py, ../common/array_math.py, sums.h.
 * Edges in windows, their clusters, and the columns of the two lines next to the middle: the same numbers as in
 * Python to the bit. Edges and clusters are integers; everything else uses the same operations in the same order,
 * and numpy's order of sums. */

#include <math.h>
#include <stdint.h>
#include "sums.h"

enum { WIDTH = 480, ROWS = 112, STRIDE = 16, WINDOW = 32, DOWN = 6, ACROSS = 29, TILES = WIDTH / STRIDE };
enum { FIRST_ROW = 235, FIRST_COLUMN = 90, STEEP_SHIFT = 8 }; /* four times the mean of 1024 squares */
enum { LEAST_EDGES = 25, NEIGHBOURS = 5, LEAST_POINTS = 30, MIDDLE = 320, ROW = 278, MISSING = 0 };
static const double PI = 3.141592653589793;

/* Data of one picture. */
typedef struct {
    int32_t *power, *crest, *limits; /* of each pixel, pixel, window */
    uint8_t *windows;                /* those with enough edges, then those with a mark */
    uint8_t *counts;                 /* number of windows in which each pixel is an edge */
    int32_t *column, *root;          /* of each edge */
    int32_t *count;                  /* number of windows of each edge */
    double *size, *mean;             /* of each cluster */
    double *room;                    /* 5 per pixel */
    double lines[2];                 /* columns of the left and right lines */
} Coded;

/* Squares of the vertical Sobel operator, mirrored at the border, and their crests. */
INLINE void crests(Coded *c, const uint8_t *restrict part)
{
    int32_t *restrict power = c->power, *restrict crest = c->crest;
    for (long y = 0; y < ROWS; y++) {
        const uint8_t *row = part + y * WIDTH;
        const uint8_t *above = y > 0 ? row - WIDTH : row + WIDTH, *below = y < ROWS - 1 ? row + WIDTH : row - WIDTH;
        int32_t *restrict here = power + y * WIDTH;
        int16_t step[WIDTH];
        for (long x = 0; x < WIDTH; x++)
            step[x] = (int16_t)(below[x] - above[x]);
        for (long x = 1; x < WIDTH - 1; x++) {
            int32_t gradient = step[x - 1] + 2 * step[x] + step[x + 1];
            here[x] = gradient * gradient;
        }
        int32_t first = 2 * (step[0] + step[1]), last = 2 * (step[WIDTH - 1] + step[WIDTH - 2]);
        here[0] = first * first, here[WIDTH - 1] = last * last;
    }
    for (long k = 0; k < WIDTH; k++)
        crest[k] = crest[(ROWS - 1) * WIDTH + k] = 0;
    for (long k = WIDTH; k < (ROWS - 1) * WIDTH; k++)
        crest[k] = (power[k - WIDTH] <= power[k]) & (power[k] > power[k + WIDTH]) ? power[k] : 0;
}

/* The steep crests of a window. */
INLINE int32_t edges_in(const int32_t *crest, int32_t limit)
{
    int32_t found = 0;
    for (long y = 0; y < WINDOW; y++)
        for (long x = 0; x < WINDOW; x++)
            found += crest[y * WIDTH + x] > limit;
    return found;
}

INLINE void edges(Coded *c, const uint8_t *part)
{
    int32_t tiles[ROWS / STRIDE][TILES] = {{0}};
    crests(c, part);
    for (long y = 0; y < ROWS; y++)
        for (long tile = 0; tile < TILES; tile++) {
            int32_t sum = 0;
            for (long k = 0; k < STRIDE; k++)
                sum += c->power[y * WIDTH + tile * STRIDE + k];
            tiles[y / STRIDE][tile] += sum;
        }
    for (long y = 0; y < DOWN; y++)
        for (long x = 0; x < ACROSS; x++) {
            int32_t sum = tiles[y][x] + tiles[y + 1][x] + tiles[y][x + 1] + tiles[y + 1][x + 1];
            int32_t limit = sum >> STEEP_SHIFT;
            c->limits[y * ACROSS + x] = limit;
            c->windows[y * ACROSS + x] = edges_in(c->crest + (y * WIDTH + x) * STRIDE, limit) >= LEAST_EDGES;
        }
}

/* Count, for each pixel, the windows with a mark in which it is an edge. */
INLINE void count_edges(Coded *c)
{
    memset(c->counts, 0, ROWS * WIDTH);
    for (long window = 0; window < DOWN * ACROSS; window++) {
        if (!c->windows[window])
            continue;
        long first = (window / ACROSS * WIDTH + window % ACROSS) * STRIDE;
        int32_t limit = c->limits[window];
        for (long y = 0; y < WINDOW; y++) {
            const int32_t *restrict crest = c->crest + first + y * WIDTH;
            uint8_t *restrict counts = c->counts + first + y * WIDTH;
            for (long x = 0; x < WINDOW; x++)
                counts[x] = (uint8_t)(counts[x] + (crest[x] > limit));
        }
    }
}

INLINE int32_t root_of(int32_t *root, int32_t k)
{
    while (root[k] != k)
        k = root[k] = root[root[k]];
    return k;
}

INLINE void link(int32_t *root, int32_t one, int32_t other)
{
    int32_t x = root_of(root, one), y = root_of(root, other);
    root[x > y ? x : y] = x > y ? y : x;
}

/* Link the edges `from` to `to` - 1 of a row with those of another row, `begin` to `end` - 1, up to `reach` columns
 * away. Only the nearest to the left and right are needed, because those further away are linked with them. */
INLINE void link_rows(const Coded *c, int32_t from, int32_t to, int32_t begin, int32_t end, int32_t reach)
{
    int32_t other = begin;
    for (int32_t k = from; k < to; k++) {
        int32_t column = c->column[k];
        while (other < end && c->column[other] < column)
            other++;
        if (other < end && c->column[other] - column <= reach)
            link(c->root, k, other);
        if (other > begin && column - c->column[other - 1] <= reach)
            link(c->root, k, other - 1);
    }
}

/* Clusters of edges, linked up to a distance of `radius`; `starts` are the rows' first edges. */
INLINE void clusters(const Coded *c, const int32_t *starts, double radius)
{
    double square = radius * radius;
    int32_t reach = (int32_t)radius;
    while ((double)(reach + 1) * (reach + 1) <= square)
        reach++;
    while (reach > 0 && (double)reach * reach > square)
        reach--;
    for (int32_t k = 0; k < starts[ROWS]; k++)
        c->root[k] = k;
    int32_t rows = reach;
    for (int32_t apart = 0; apart <= rows && apart < ROWS; apart++) {
        while ((double)reach * reach + (double)apart * apart > square)
            reach--;
        for (int32_t y = apart; y < ROWS; y++) {
            if (apart == 0) {
                for (int32_t k = starts[y] + 1; k < starts[y + 1]; k++)
                    if (c->column[k] - c->column[k - 1] <= reach)
                        link(c->root, k, k - 1);
            } else if (starts[y] < starts[y + 1] && starts[y - apart] < starts[y - apart + 1]) {
                link_rows(c, starts[y], starts[y + 1], starts[y - apart], starts[y - apart + 1], reach);
            }
        }
    }
}

/* The column in which the line fitted to a cluster crosses the row where lines are read. */
static double crossing(const Coded *c, const int32_t *starts, int32_t cluster)
{
    enum { PIXELS = ROWS * WIDTH };
    double *weight = c->room, *row = weight + PIXELS, *column = row + PIXELS, *scaled = column + PIXELS;
    double *room = scaled + PIXELS;
    long count = 0;
    for (long y = 0; y < ROWS; y++)
        for (int32_t k = starts[y]; k < starts[y + 1]; k++) {
            weight[count] = (double)c->count[k] / c->size[cluster];
            row[count] = (double)(y + FIRST_ROW), column[count] = (double)(c->column[k] + FIRST_COLUMN);
            count += c->root[k] == cluster;
        }
    double mean_row = dot(weight, row, count, room), mean_column = dot(weight, column, count, room);
    for (long k = 0; k < count; k++) {
        row[k] -= mean_row;
        scaled[k] = weight[k] * row[k];
    }
    double power = dot(scaled, row, count, room);
    double slope = power != 0.0 ? dot(scaled, column, count, room) / power : 0.0;
    return mean_column + slope * ((double)ROW - mean_row);
}

/* List edges row by row, left to right, and the first edge of each row. Returns their number, summed over all windows. */
INLINE long list_edges(Coded *c, int32_t *starts, double *box)
{
    int32_t found = 0, left = WIDTH, right = 0, top = ROWS, bottom = 0;
    long all = 0;
    for (int32_t y = 0; y < ROWS; y++) {
        starts[y] = found;
        for (int32_t x = 0; x < WIDTH; x += 8) {
            uint64_t any;
            memcpy(&any, c->counts + y * WIDTH + x, sizeof any);
            if (any)
                for (int32_t k = x; k < x + 8; k++) {
                    int32_t count = c->counts[y * WIDTH + k];
                    c->column[found] = k, c->count[found] = count;
                    found += count > 0, all += count;
                }
        }
        if (found > starts[y]) {
            top = top < y ? top : y, bottom = y;
            left = left < c->column[starts[y]] ? left : c->column[starts[y]];
            right = right > c->column[found - 1] ? right : c->column[found - 1];
        }
    }
    starts[ROWS] = found;
    *box = (double)((int64_t)(bottom - top) * (right - left) * NEIGHBOURS);
    return all;
}

INLINE long lines(Coded *c)
{
    int32_t starts[ROWS + 1], nearest[2] = {-1, -1};
    double box;
    count_edges(c);
    long all = list_edges(c, starts, &box);
    if (!all)
        return 0;
    clusters(c, starts, sqrt(box / ((double)all * PI)));
    int32_t edges = starts[ROWS];
    for (int32_t k = 0; k < edges; k++) { /* the root is the first edge of its cluster */
        int32_t of = c->root[k] = root_of(c->root, k);
        if (of == k)
            c->size[k] = c->mean[k] = 0.0;
        c->size[of] += c->count[k], c->mean[of] += (double)c->count[k] * (c->column[k] + FIRST_COLUMN);
    }
    for (int32_t k = 0; k < edges; k++) {
        if (c->root[k] != k || c->size[k] < LEAST_POINTS)
            continue;
        double mean = c->mean[k] /= c->size[k];
        if (mean < MIDDLE && (nearest[0] < 0 || mean > c->mean[nearest[0]]))
            nearest[0] = k;
        if (mean > MIDDLE && (nearest[1] < 0 || mean < c->mean[nearest[1]]))
            nearest[1] = k;
    }
    for (int side = 0; side < 2; side++)
        c->lines[side] = nearest[side] < 0 ? MISSING : crossing(c, starts, nearest[side]);
    return 1;
}

static void edges_plain(Coded *c, const uint8_t *part)
{
    edges(c, part);
}

static long lines_plain(Coded *c)
{
    return lines(c);
}

#if defined(__x86_64__) && !defined(PLAIN)
#define FAST __attribute__((target("avx2")))
#define CHOOSE(name, ...) __builtin_cpu_supports("avx2") ? name##_fast(__VA_ARGS__) : name##_plain(__VA_ARGS__)

FAST static void edges_fast(Coded *c, const uint8_t *part)
{
    edges(c, part);
}

FAST static long lines_fast(Coded *c)
{
    return lines(c);
}
#else
#define CHOOSE(name, ...) name##_plain(__VA_ARGS__)
#endif

/* First step: edges of `part`, and the windows to examine. */
void take_edges(Coded *c, const uint8_t *part)
{
    CHOOSE(edges, c, part);
}

/* Second step: lines through edges in windows with a mark. Returns 0 if there is no edge. */
long take_lines(Coded *c)
{
    return CHOOSE(lines, c);
}
