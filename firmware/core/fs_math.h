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

typedef struct {
    fs_real sine, cosine;
} fs_sine_cosine;

/*
 * Sine and cosine of an angle [rad]; both NaN beyond FS_LARGEST_ANGLE_RAD and for what is not finite.
 *
 * Error: see docs/explanation/firmware.md; tests/firmware/test_core_math.py measures it.
 */
fs_sine_cosine fs_sin_cos(fs_real angle_rad);

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

/*
 * Part of a sum that tells whether any of up to 64 numbers is not finite, for less than a comparison of each would
 * cost: begin with 0, add them, and look whether the sum is finite. A number counts a 64th, so that large ones do not
 * make it infinite; infinities of both signs make it NaN.
 */
static inline fs_real fs_add_part(fs_real sum, fs_real value)
{
    return sum + FS_LIT(0.015625) * value;
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

#endif
