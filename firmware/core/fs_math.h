/*
 * The functions that the loops need of a mathematics library, so that results depend on none.
 *
 * Only + - * / and square root are used, which IEEE 754 rounds in one way: every machine that follows it, and does
 * not contract or reorder (-ffp-contract=off, no fast-math), gives the same bits.
 */
#ifndef FS_MATH_H
#define FS_MATH_H

#include "fs_real.h"

#if !defined(__GNUC__)
#include <math.h>
#endif

/* Angles up to this, of either sign, have a sine; 1e4 rad is 1591 turns. */
#define FS_LARGEST_ANGLE_RAD FS_LIT(10000.0)

/*
 * Sine and cosine of an angle [rad]; both NaN beyond FS_LARGEST_ANGLE_RAD and if not finite.
 *
 * Error: see docs/explanation/firmware.md; tests/firmware/test_core_math.py measures it.
 */
void fs_sin_cos(fs_real angle_rad, fs_real *sine_out, fs_real *cosine_out);

/* Correctly rounded square root; the argument must not be negative. */
static inline fs_real fs_sqrt(fs_real square)
{
#if defined(FS_DOUBLE)
    return __builtin_sqrt(square);
#elif defined(__GNUC__)
    return __builtin_sqrtf(square);
#else
    return sqrtf(square);
#endif
}

static inline fs_real fs_abs(fs_real value)
{
#if defined(FS_DOUBLE)
    return __builtin_fabs(value);
#elif defined(__GNUC__)
    return __builtin_fabsf(value);
#else
    return fabsf(value);
#endif
}

/* Neither infinite nor NaN. By comparison, because some processors take a NaN for an infinity. */
static inline uint16_t fs_is_finite(fs_real value)
{
    return fs_abs(value) <= FS_REAL_MAX ? 1U : 0U;
}

/* Python's max and min: the first argument unless the second is beyond it, also when one is NaN. */
static inline fs_real fs_max(fs_real first, fs_real second)
{
    return second > first ? second : first;
}

static inline fs_real fs_min(fs_real first, fs_real second)
{
    return second < first ? second : first;
}

/* Arc tangent of a ratio, divided by it, less one; of the ratio's square up to 0.1715. Chebyshev's nodes. */
static inline fs_real fs_arc_tangent_series(fs_real square)
{
    fs_real sum;
#ifdef FS_DOUBLE
    sum = -0.01917454357202133; /* off by 5e-18 at most */
    sum = sum * square + 0.039229744536612224;
    sum = sum * square - 0.05085383488842831;
    sum = sum * square + 0.05858136251906146;
    sum = sum * square - 0.06664509989818045;
    sum = sum * square + 0.07692183087342026;
    sum = sum * square - 0.0909090457366906;
    sum = sum * square + 0.11111111015146714;
    sum = sum * square - 0.1428571428466518;
    sum = sum * square + 0.19999999999995513;
    sum = sum * square - 0.3333333333333333;
#else
    sum = -0.06451597258952992F; /* off by 3e-9 at most */
    sum = sum * square + 0.10743631627144574F;
    sum = sum * square - 0.1426394635791234F;
    sum = sum * square + 0.19999540216937534F;
    sum = sum * square - 0.3333333176000804F;
#endif
    return sum * square;
}

#endif
