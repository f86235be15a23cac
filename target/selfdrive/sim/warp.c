/* Stands for: warp.py.
 * Warps a region to the same bytes as OpenCV's warpPerspective (bilinear, border repeated, since 4.11) gives for
 * the whole: matrix and positions in single precision, products and sums fused. This must not be used where OpenCV
 * calculates differently, for example on a processor without such instructions. */

#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

typedef struct {
    const uint8_t *pixels;
    int32_t rows, width;
} Picture;

INLINE int32_t within(int32_t place, int32_t size)
{
    return place < 0 ? 0 : place < size ? place : size - 1;
}

/* Floor as processors convert it: a value that no int can hold becomes the smallest int. */
INLINE int32_t floor_of(float value)
{
    float whole = floorf(value);
    return whole >= -2147483648.0f && whole < 2147483648.0f ? (int32_t)whole : INT32_MIN;
}

INLINE uint8_t rounded(float level)
{
    if (!(level >= 0.0f))
        return 0;
    return level >= 255.0f ? 255 : (uint8_t)rintf(level);
}

/* Interpolate the level between four pixels of the picture. */
INLINE uint8_t between(const Picture *picture, float across, float down)
{
    int32_t column = floor_of(across), row = floor_of(down);
    float right = across - (float)column, low = down - (float)row;
    const uint8_t *upper = picture->pixels + (int64_t)within(row, picture->rows) * picture->width;
    const uint8_t *lower = picture->pixels + (int64_t)within(row + 1, picture->rows) * picture->width;
    int32_t here = within(column, picture->width), beside = within(column + 1, picture->width);
    float top = fmaf(right, (float)(upper[beside] - upper[here]), upper[here]);
    float bottom = fmaf(right, (float)(lower[beside] - lower[here]), lower[here]);
    return rounded(fmaf(low, bottom - top, top));
}

/* Warp columns `from` to `to` - 1 of a row; `m` maps (column, row) to the picture, and `start` is the row's part of
 * the result. */
INLINE void one_by_one(const Picture *picture, const float *m, const float *start, long from, long to, uint8_t *out)
{
    for (long x = from; x < to; x++) {
        float scale = fmaf(m[6], (float)x, start[2]);
        float across = fmaf(m[0], (float)x, start[0]) / scale, down = fmaf(m[3], (float)x, start[1]) / scale;
        *out++ = between(picture, across, down);
    }
}

static void plain(const Picture *picture, const float *m, const float *start, long from, long to, uint8_t *out)
{
    one_by_one(picture, m, start, from, to, out);
}

#if defined(__x86_64__)
#include <immintrin.h>
#define FAST __attribute__((target("avx2,fma")))
#ifndef IS_FAST /* tests set this */
#define IS_FAST (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
#endif

FAST static inline __m256 eight(__m128i levels)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(levels));
}

FAST static inline __m256i eight_within(__m256i places, int32_t size)
{
    return _mm256_max_epi32(_mm256_min_epi32(places, _mm256_set1_epi32(size - 1)), _mm256_setzero_si256());
}

/* Levels of eight pixels at any positions. Each is read with the three after it, or before it at the end. */
FAST static inline __m256 eight_of(const Picture *picture, __m256i row, __m256i column)
{
    __m256i place = _mm256_add_epi32(_mm256_mullo_epi32(row, _mm256_set1_epi32(picture->width)), column);
    __m256i from = _mm256_min_epi32(place, _mm256_set1_epi32(picture->rows * picture->width - 4));
    __m256i bytes = _mm256_i32gather_epi32((const int *)picture->pixels, from, 1);
    bytes = _mm256_srlv_epi32(bytes, _mm256_slli_epi32(_mm256_sub_epi32(place, from), 3));
    return _mm256_cvtepi32_ps(_mm256_and_si256(bytes, _mm256_set1_epi32(255)));
}

/* The same, eight columns at a time. */
FAST static void fast(const Picture *picture, const float *m, const float *start, long from, long to, uint8_t *out)
{
    const __m256i steps = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    const __m256i bytes = _mm256_setr_epi8(0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
                                           -1, -1, -1, -1, 0, 4, 8, 12, -1, -1, -1, -1, -1, -1, -1, -1);
    const __m256i width = _mm256_set1_epi32(picture->width), last = _mm256_set1_epi32(picture->width - 1);
    const __m256i end = _mm256_set1_epi32(picture->rows * picture->width - picture->width - 17);
    const __m256i none = _mm256_set1_epi32(-1), low_byte = _mm256_set1_epi32(255);
    const __m256 m0 = _mm256_set1_ps(m[0]), m3 = _mm256_set1_ps(m[3]), m6 = _mm256_set1_ps(m[6]);
    const __m256 s0 = _mm256_set1_ps(start[0]), s1 = _mm256_set1_ps(start[1]), s2 = _mm256_set1_ps(start[2]);
    long x = from;
    for (; x + 8 <= to; x += 8, out += 8) {
        __m256 at = _mm256_cvtepi32_ps(_mm256_add_epi32(_mm256_set1_epi32((int)x), steps));
        __m256 scale = _mm256_fmadd_ps(m6, at, s2);
        __m256 across = _mm256_div_ps(_mm256_fmadd_ps(m0, at, s0), scale);
        __m256 down = _mm256_div_ps(_mm256_fmadd_ps(m3, at, s1), scale);
        __m256i column = _mm256_cvtps_epi32(_mm256_floor_ps(across));
        __m256i row = _mm256_cvtps_epi32(_mm256_floor_ps(down));
        __m256i place = _mm256_add_epi32(_mm256_mullo_epi32(row, width), column);
        __m256i inside = _mm256_and_si256(
            _mm256_and_si256(_mm256_cmpgt_epi32(column, none), _mm256_cmpgt_epi32(last, column)),
            _mm256_and_si256(_mm256_cmpgt_epi32(row, none), _mm256_cmpgt_epi32(end, place)));
        /* Beyond some thousand rows, the product for the position can overflow, so `inside` also tests the row. */
        inside = _mm256_and_si256(inside, _mm256_cmpgt_epi32(_mm256_set1_epi32(picture->rows - 1), row));
        __m256 here, beside, under, last_one;
        int32_t first = _mm256_extract_epi32(place, 0);
        __m256i away = _mm256_sub_epi32(place, _mm256_set1_epi32(first));
        __m256i far = _mm256_or_si256(_mm256_cmpgt_epi32(away, _mm256_set1_epi32(14)), _mm256_cmpgt_epi32(_mm256_setzero_si256(), away));
        if (_mm256_movemask_epi8(inside) != -1) {
            const __m256i one = _mm256_set1_epi32(1);
            __m256i left = eight_within(column, picture->width), upper = eight_within(row, picture->rows);
            __m256i next = eight_within(_mm256_add_epi32(column, one), picture->width);
            __m256i lower = eight_within(_mm256_add_epi32(row, one), picture->rows);
            here = eight_of(picture, upper, left), beside = eight_of(picture, upper, next);
            under = eight_of(picture, lower, left), last_one = eight_of(picture, lower, next);
        } else if (_mm256_testz_si256(far, far)) { /* all within sixteen pixels of two rows */
            __m256i packed = _mm256_shuffle_epi8(away, bytes);
            __m128i chosen = _mm_or_si128(_mm256_castsi256_si128(packed), _mm256_extracti128_si256(packed, 1));
            chosen = _mm_unpacklo_epi64(chosen, _mm_add_epi8(chosen, _mm_set1_epi8(1)));
            const uint8_t *upper = picture->pixels + first, *lower = upper + picture->width;
            __m128i above = _mm_shuffle_epi8(_mm_loadu_si128((const __m128i *)upper), chosen);
            __m128i below = _mm_shuffle_epi8(_mm_loadu_si128((const __m128i *)lower), chosen);
            here = eight(above), beside = eight(_mm_srli_si128(above, 8));
            under = eight(below), last_one = eight(_mm_srli_si128(below, 8));
        } else {
            __m256i above = _mm256_i32gather_epi32((const int *)picture->pixels, place, 1);
            __m256i below = _mm256_i32gather_epi32((const int *)(picture->pixels + picture->width), place, 1);
            here = _mm256_cvtepi32_ps(_mm256_and_si256(above, low_byte));
            beside = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(above, 8), low_byte));
            under = _mm256_cvtepi32_ps(_mm256_and_si256(below, low_byte));
            last_one = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(below, 8), low_byte));
        }
        __m256 right = _mm256_sub_ps(across, _mm256_cvtepi32_ps(column));
        __m256 low = _mm256_sub_ps(down, _mm256_cvtepi32_ps(row));
        __m256 top = _mm256_fmadd_ps(right, _mm256_sub_ps(beside, here), here);
        __m256 bottom = _mm256_fmadd_ps(right, _mm256_sub_ps(last_one, under), under);
        __m256i level = _mm256_cvtps_epi32(_mm256_fmadd_ps(low, _mm256_sub_ps(bottom, top), top));
        __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(level), _mm256_extracti128_si256(level, 1));
        _mm_storel_epi64((__m128i *)out, _mm_packus_epi16(words, words));
    }
    one_by_one(picture, m, start, x, to, out);
}

#ifndef IS_WIDE
#define IS_WIDE                                                                                                     \
    (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") && \
     __builtin_cpu_supports("avx512vbmi"))
#endif
#define WIDE __attribute__((target("avx512f,avx512bw,avx512vl,avx512vbmi")))

WIDE static inline __m512 sixteen(__m128i levels)
{
    return _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(levels));
}

/* The same, sixteen columns at a time, if these lie within the picture and within 63 pixels of two rows. */
WIDE static void wide(const Picture *picture, const float *m, const float *start, long from, long to, uint8_t *out)
{
    const __m512i steps = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m512i width = _mm512_set1_epi32(picture->width), last = _mm512_set1_epi32(picture->width - 1);
    const __m512i last_row = _mm512_set1_epi32(picture->rows - 1);
    const __m512 m0 = _mm512_set1_ps(m[0]), m3 = _mm512_set1_ps(m[3]), m6 = _mm512_set1_ps(m[6]);
    const __m512 s0 = _mm512_set1_ps(start[0]), s1 = _mm512_set1_ps(start[1]), s2 = _mm512_set1_ps(start[2]);
    const int32_t end = picture->rows * picture->width - picture->width - 64;
    long x = from;
    for (; x + 16 <= to; x += 16, out += 16) {
        __m512 at = _mm512_cvtepi32_ps(_mm512_add_epi32(_mm512_set1_epi32((int)x), steps));
        __m512 scale = _mm512_fmadd_ps(m6, at, s2);
        __m512 across = _mm512_div_ps(_mm512_fmadd_ps(m0, at, s0), scale);
        __m512 down = _mm512_div_ps(_mm512_fmadd_ps(m3, at, s1), scale);
        __m512 left = _mm512_roundscale_ps(across, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
        __m512 top = _mm512_roundscale_ps(down, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
        __m512i column = _mm512_cvtps_epi32(left), row = _mm512_cvtps_epi32(top);
        __m512i place = _mm512_add_epi32(_mm512_mullo_epi32(row, width), column);
        int32_t first = _mm512_cvtsi512_si32(place);
        __m512i away = _mm512_sub_epi32(place, _mm512_set1_epi32(first));
        __mmask16 near = _mm512_cmplt_epu32_mask(column, last); /* unsigned, so negative numbers are large */
        near = _mm512_mask_cmplt_epu32_mask(near, row, last_row);
        near = _mm512_mask_cmplt_epu32_mask(near, away, _mm512_set1_epi32(63));
        if (near != 0xffff || first >= end) {
            fast(picture, m, start, x, x + 16, out);
            continue;
        }
        __m128i here = _mm512_cvtepi32_epi8(away), beside = _mm_add_epi8(here, _mm_set1_epi8(1));
        __m512i chosen = _mm512_castsi256_si512(_mm256_set_m128i(beside, here));
        const uint8_t *upper = picture->pixels + first, *lower = upper + picture->width;
        __m256i above = _mm512_castsi512_si256(_mm512_permutexvar_epi8(chosen, _mm512_loadu_si512(upper)));
        __m256i below = _mm512_castsi512_si256(_mm512_permutexvar_epi8(chosen, _mm512_loadu_si512(lower)));
        __m512 right = _mm512_sub_ps(across, left), low = _mm512_sub_ps(down, top);
        __m512 from_upper = sixteen(_mm256_castsi256_si128(above)), from_lower = sixteen(_mm256_castsi256_si128(below));
        __m512 by_upper = _mm512_sub_ps(sixteen(_mm256_extracti128_si256(above, 1)), from_upper);
        __m512 by_lower = _mm512_sub_ps(sixteen(_mm256_extracti128_si256(below, 1)), from_lower);
        __m512 over = _mm512_fmadd_ps(right, by_upper, from_upper);
        __m512 under = _mm512_fmadd_ps(right, by_lower, from_lower);
        __m512i level = _mm512_cvtps_epi32(_mm512_fmadd_ps(low, _mm512_sub_ps(under, over), over));
        _mm_storeu_si128((__m128i *)out, _mm512_cvtusepi32_epi8(_mm512_max_epi32(level, _mm512_setzero_si512())));
    }
    fast(picture, m, start, x, to, out);
}
#endif

/* Rows `top` to `bottom` - 1 and columns `left` to `right` - 1 of the warped picture, which has the picture's size. */
void warp(const uint8_t *pixels, long rows, long width, const double *matrix, long top, long bottom, long left,
          long right, uint8_t *out)
{
    void (*draw)(const Picture *, const float *, const float *, long, long, uint8_t *) = plain;
#if defined(__x86_64__)
    if (IS_FAST && rows * width > 3 && rows * width < (1 << 30))
        draw = IS_WIDE ? wide : fast;
#endif
    Picture picture = {pixels, (int32_t)rows, (int32_t)width};
    float m[9], start[3];
    for (int k = 0; k < 9; k++)
        m[k] = (float)matrix[k];
    for (long y = top; y < bottom; y++, out += right - left) {
        for (int k = 0; k < 3; k++) {
            float by = (float)y * m[3 * k + 1]; /* not fused */
            start[k] = by + m[3 * k + 2];
        }
        draw(&picture, m, start, left, right, out);
    }
}
