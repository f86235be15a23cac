/* Sums in numpy's order, for the same bits. */

#include <string.h>

#define INLINE static inline __attribute__((always_inline))

/* Numpy's sum of contiguous values. */
static double sum_of(const double *values, long count)
{
    if (count < 8) {
        double sum = 0.0;
        for (long k = 0; k < count; k++)
            sum += values[k];
        return sum;
    }
    if (count > 128) {
        long half = count / 2 - count / 2 % 8;
        return sum_of(values, half) + sum_of(values + half, count - half);
    }
    double s[8];
    long k = 8;
    memcpy(s, values, sizeof s);
    for (; k < count - count % 8; k += 8)
        for (long lane = 0; lane < 8; lane++)
            s[lane] += values[k + lane];
    double sum = ((s[0] + s[1]) + (s[2] + s[3])) + ((s[4] + s[5]) + (s[6] + s[7]));
    for (; k < count; k++)
        sum += values[k];
    return sum;
}

static double dot(const double *a, const double *b, long count, double *room)
{
    for (long k = 0; k < count; k++)
        room[k] = a[k] * b[k];
    return sum_of(room, count);
}

/* The scalar product as calculated here, to compare with numpy's. */
double product(const double *a, const double *b, long count, double *room)
{
    return dot(a, b, count, room);
}
