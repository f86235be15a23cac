/* Stands for: road_view.py.
 * The picture as a map of the road, with OpenCV's bits: integers, rounded to nearest. */

#include <stdint.h>

enum { LEVELS = 3, PARTS = 5 }; /* pictures, each half as large as the previous; bits of a pixel's fraction */

typedef struct {
    int64_t rows, first;   /* of the map, and the first row of its picture */
    const int32_t *places; /* rows x columns: 64 times the left pixel's column, plus 32nds beyond it */
} Level;

typedef struct {
    int64_t rows, width, columns; /* of the picture; of the map */
    Level levels[LEVELS];
    uint8_t *smaller[LEVELS - 1]; /* the second and third picture, with space for four more pixels */
    uint8_t *road;
} View;

static void halve(const uint8_t *restrict from, long rows, long width, uint8_t *restrict to)
{
    for (long y = 0; y < rows; y++) {
        const uint8_t *restrict upper = from + 4 * y * width, *restrict lower = upper + 2 * width;
        for (long x = 0; x < width; x++)
            to[y * width + x] = (uint8_t)((upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
    }
}

static void take_row(const uint8_t *row, const int32_t *places, long columns, uint8_t *out)
{
    for (long x = 0; x < columns; x++) {
        const uint8_t *pixel = row + (places[x] >> (PARTS + 1));
        int beyond = places[x] & ((2 << PARTS) - 1);
        out[x] = (uint8_t)(((pixel[0] << PARTS) + (pixel[1] - pixel[0]) * beyond + (1 << (PARTS - 1))) >> PARTS);
    }
}

#if defined(__x86_64__) && !defined(PLAIN)
#include <immintrin.h>

/* The same, eight columns at a time. Reads two pixels more than are used. */
__attribute__((target("avx2"))) static void take_row_fast(const uint8_t *row, const int32_t *places, long columns,
                                                          uint8_t *out)
{
    const __m256i byte = _mm256_set1_epi32(255), beyond = _mm256_set1_epi32((2 << PARTS) - 1);
    const __m256i half = _mm256_set1_epi32(1 << (PARTS - 1));
    long x = 0;
    for (; x + 8 <= columns; x += 8) {
        __m256i place = _mm256_loadu_si256((const __m256i *)(places + x));
        __m256i pixels = _mm256_i32gather_epi32((const int *)row, _mm256_srai_epi32(place, PARTS + 1), 1);
        __m256i left = _mm256_and_si256(pixels, byte), right = _mm256_and_si256(_mm256_srli_epi32(pixels, 8), byte);
        __m256i more = _mm256_mullo_epi32(_mm256_sub_epi32(right, left), _mm256_and_si256(place, beyond));
        __m256i level = _mm256_add_epi32(_mm256_add_epi32(_mm256_slli_epi32(left, PARTS), more), half);
        level = _mm256_srai_epi32(level, PARTS);
        __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(level), _mm256_extracti128_si256(level, 1));
        _mm_storel_epi64((__m128i *)(out + x), _mm_packus_epi16(words, words));
    }
    take_row(row, places + x, columns - x, out + x);
}
#endif

/* The map of a picture whose rows and columns can be halved once per level without remainder. */
void take_map(const View *view, const uint8_t *picture)
{
    void (*take)(const uint8_t *, const int32_t *, long, uint8_t *) = take_row;
#if defined(__x86_64__) && !defined(PLAIN)
    if (__builtin_cpu_supports("avx2"))
        take = take_row_fast;
#endif
    uint8_t *out = view->road;
    long rows = view->rows, width = view->width;
    for (int k = 0; k < LEVELS; k++, rows /= 2, width /= 2) {
        const Level *level = &view->levels[k];
        for (long y = 0; y < level->rows; y++, out += view->columns) {
            int is_last = k == 0 && level->first + y == rows - 1; /* of an array that can end with its last pixel */
            (is_last ? take_row : take)(picture + (level->first + y) * width, level->places + y * view->columns,
                                        view->columns, out);
        }
        if (k + 1 < LEVELS) {
            halve(picture, rows / 2, width / 2, view->smaller[k]);
            picture = view->smaller[k];
        }
    }
}
